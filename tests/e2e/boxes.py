"""Measures the layout on the screen: no text may be truncated, and no two elements may overlap."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
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
    """List the elements that stay truncated or overlapping; a busy machine may lay out late.

    Args:
        page: The page as it is now.
        measure: A function of the page, which returns a list.
        usual: Parts of the descriptions of findings that are no faults on this page.
    """
    script = _WHEN_LAID_OUT.replace("MEASURE", measure)
    for _ in range(_LOOKS):
        every = page.evaluate(script)
        found = [fault for fault in every if not any(part in fault for part in usual)]
        if not found:
            break
        page.wait_for_timeout(200)
    return found


def sized(page: Any, sizes: Iterable[tuple[tuple[int, int], int]]) -> Iterator[str]:
    """Give the page each size, with its text size in percent; yield the name of each size."""
    devtools = page.context.new_cdp_session(page)
    for (width, height), text in sizes:
        page.evaluate(f"document.documentElement.style.fontSize = '{text}%'")
        size = {"width": width, "height": height, "screenWidth": width, "screenHeight": height}
        devtools.send(
            "Emulation.setDeviceMetricsOverride", {**size, "deviceScaleFactor": 1, "mobile": False}
        )
        yield f"{width}x{height} {text} %"
    devtools.detach()


def in_language(browser: Any, language: str) -> Any:
    """Return a fresh browser with a touch screen; see `speak_longer` for the language `longer`."""
    locale = "en" if language == "longer" else language
    context = browser.new_context(locale=locale, has_touch=True, service_workers="block")
    if language == "longer":
        speak_longer(context)
    return context


def speak_longer(context: Any) -> None:
    """Have the page use an invented language, half as long again as English, with tall letters.

    Words of this language may fill a button's padding; words of a real language may not.
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
