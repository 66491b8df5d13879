"""Measures the layout on the screen: no text may be truncated, and no two elements may overlap."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

_HERE = Path(__file__).parent
_LOOKS = 20
MEASURE = (_HERE / "boxes.js").read_text().split("\n", 2)[2].strip()
_WHEN_LAID_OUT = """async () => {
  // A frame later everything that follows the size has followed it.
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  return (MEASURE)();
}"""


def faults(page: Any, measure: str = MEASURE, usual: tuple[str, ...] = ()) -> list[str]:
    """List the truncated or overlapping elements that stay so; a busy machine lays out late.

    Args:
        page: As it is now.
        measure: A function of the page, which returns a list.
        usual: Parts of descriptions of faults that are not faults on this page.
    """
    script = _WHEN_LAID_OUT.replace("MEASURE", measure)
    for _ in range(_LOOKS):
        every = page.evaluate(script)
        found = [fault for fault in every if not any(part in fault for part in usual)]
        if not found:
            break
        page.wait_for_timeout(200)
    return found


def speak_longer(context: Any) -> None:
    """Have the page use a language half as long again as English, with tall letters.

    It may fill a button's padding, which no real language may.
    """
    context.add_init_script("window.isMadeUp = true")

    def answer(route: Any) -> None:
        response = route.fetch()
        text = re.sub(r"(: ')((?:[^'\\]|\\.)*)(',)", _longer, response.text())
        route.fulfill(response=response, body=text)

    context.route(re.compile(r"/messages/en\.js|/js/[0-9a-f]{10}-(?:later-)?en\.js"), answer)


def _longer(match: re.Match[str]) -> str:
    sentence = match.group(2)
    parts = re.split(r"(\{\w+\}|\\.)", sentence)
    tall = str.maketrans("aeiouAEIOUcn", "âéîöúÂÉÎÖÚçñ")
    text = "".join(part if i % 2 else part.translate(tall) for i, part in enumerate(parts))
    words = text.split(" ")
    extra = words[: max(1, len(words) // 2)] if len(words) > 1 else [text[: len(text) // 2]]
    extra = [re.sub(r"\{\w+\}|\\.?", "", word) for word in extra]
    joined = text + ("" if len(words) == 1 else " ") + " ".join(word for word in extra if word)
    return match.group(1) + joined.rstrip() + match.group(3)


NOTICES: list[dict[str, Any]] = [
    {},
    {"hint": "correct"},
    {"robot": {"emergency": True}},
    {"robot": {"you_are_pilot": False, "pilot": "c9"}},
    {"robot": {"you_are_pilot": False, "pilot": None}},
    {"wheelAsked": True},
    {"localStop": "hidden"},
    {"robot": {"mode": "stopped", "stop_reason": "link_slow"}},
    {
        "robot": {
            "mode": "autonomous",
            "asks_pilot": True,
            "driven_by": "robot",
            "action": "left",
        }
    },
    {"robot": {"mode": "train", "driven_by": "pilot", "action": "forward"}},
    {"link": "lost"},
]
"""Elements that may lie over the picture."""


_UNDER_EACH_NOTICE = """() => {
  const list = LIST;
  const { store } = document.querySelector('video-view').page;
  const before = store.state;
  const sensed = { mode: 'train', distance_m: 1.23, bumped: true, battery: 0.78,
    agreement: 0.93, agreement_frames: 100 };
  return NOTICES.flatMap((change) => {
    store.set({ ...change, robot: { ...before.robot, ...sensed, ...change.robot } });
    const found = list().map((fault) => `${JSON.stringify(change)}: ${fault}`);
    store.set(before);
    return found;
  });
}"""


def drive_faults(page: Any) -> list[str]:
    """List the faults of the drive screen under every message that it may show."""
    measure = _UNDER_EACH_NOTICE.replace("LIST", MEASURE).replace("NOTICES", json.dumps(NOTICES))
    return faults(page, measure)
