"""Measures what is on the screen: no text may be cut, and no two things may lie on each other."""

from __future__ import annotations

import json
import re
from typing import Any

MEASURE = r"""
() => {
  const visible = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const name = (e) => {
    const own = e.className && typeof e.className === 'string' ? `.${e.className.split(' ').join('.')}` : '';
    const text = (e.textContent || e.getAttribute('aria-label') || '').trim().slice(0, 40);
    return `${e.localName}${own} "${text}"`;
  };
  const unseen = (e) => e.closest('.unseen, [hidden], .skip');
  // Every run of text, by its ink's box; every control; every picture.
  const leaves = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const e = node.parentElement;
    if (!node.data.trim() || !visible(e) || unseen(e) || e.closest('noscript, script, option')) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      if (box.width > 1 && box.height > 1) leaves.push({ e, box, isText: true });
    }
  }
  for (const e of document.querySelectorAll('button, a.button, input, select, img, canvas, svg:not(.icon)')) {
    if (!visible(e) || unseen(e) || e.classList.contains('camera')) continue;
    leaves.push({ e, box: e.getBoundingClientRect(), isText: false });
  }
  const found = [];
  const scrolls = (style) => /auto|scroll/.test(style.overflowY);
  for (const { e, box, isText } of leaves) {
    let canScroll = false;
    let floats = false;
    for (let up = e; up; up = up.parentElement) {
      const style = getComputedStyle(up);
      floats ||= style.position === 'fixed';
      if (up !== e && scrolls(style) && up.scrollHeight > up.clientHeight) canScroll = true;
      if (!isText && up === e) continue;
      if (style.overflowX === 'visible' && style.overflowY === 'visible') continue;
      if (up === document.body || up === document.documentElement) continue;
      const clip = up.getBoundingClientRect();
      if (box.left < clip.left - 2 || box.right > clip.right + 2) found.push(`cut at the side: ${name(e)}`);
      if (!scrolls(style) && (box.top < clip.top - 3 || box.bottom > clip.bottom + 3)) {
        found.push(`cut above or below: ${name(e)}`);
      }
      if (isText && style.textOverflow === 'ellipsis' && up.scrollWidth > up.clientWidth + 1) found.push(`shortened: ${name(e)}`);
    }
    if (box.left < -2 || box.right > innerWidth + 2) found.push(`outside of the window: ${name(e)}`);
    if (!canScroll && (box.top < -2 || box.bottom > innerHeight + 2)) found.push(`below the window: ${name(e)}`);
  }
  const layer = (e) => e.closest('#menu, toast-bar, .toasts, .detail, undo-screen .wide, .sticky, header') ?? document.body;
  for (let i = 0; i < leaves.length; i += 1) {
    const a = leaves[i];
    for (let j = i + 1; j < leaves.length; j += 1) {
      const b = leaves[j];
      if (a.e === b.e || a.e.contains(b.e) || b.e.contains(a.e)) continue;
      if (layer(a.e) !== layer(b.e)) continue;
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const along = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (across > 2 && along > 3) found.push(`overlap: ${name(a.e)} and ${name(b.e)}`);
    }
  }
  const stops = [...document.querySelectorAll('button.stop')].filter(visible).map((e) => e.getBoundingClientRect());
  if (!stops.some((box) => box.top >= 0 && box.left >= 0 && box.bottom <= innerHeight && box.right <= innerWidth)) {
    found.push('STOP is not on the screen');
  }
  if (document.documentElement.scrollWidth > innerWidth) found.push('the page is too wide');
  return [...new Set(found)];
}
"""


def faults(page: Any) -> list[str]:
    """List what is cut or lies on something else on the page as it is now."""
    return list(page.evaluate(MEASURE))


def speak_longer(context: Any) -> None:
    """Have the page speak a language half as long again as English, with tall letters."""

    def answer(route: Any) -> None:
        response = route.fetch()
        text = re.sub(r"(: ')((?:[^'\\]|\\.)*)(',)", _longer, response.text())
        route.fulfill(response=response, body=text)

    context.route(re.compile(r"/js/(.*/)?messages/.*en\.js|/js/.*/words\.js"), answer)


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


NOTICES = json.dumps(
    [
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
)
"""What may stand over the picture."""


def drive_faults(page: Any) -> list[str]:
    """List the faults of the drive screen under everything that it may have to say."""
    script = f"""() => {{
      const measure = {MEASURE};
      const {{ store }} = document.querySelector('video-view').page;
      const before = store.state;
      const found = [];
      for (const change of {NOTICES}) {{
        store.set({{ ...change, robot: {{ ...before.robot, mode: 'train', distance_m: 1.23, bumped: true,
          battery: 0.78, agreement: 0.93, ...change.robot }} }});
        found.push(...measure().map((fault) => `${{JSON.stringify(change)}}: ${{fault}}`));
        store.set(before);
      }}
      return found;
    }}"""
    return list(page.evaluate(script))
