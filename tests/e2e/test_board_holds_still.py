"""Whatever a class's robots report, no STOP of the board moves under the teacher's hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.kit.sizes import few

from .class_world import running_class

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SIZES = [
    (280, 653),
    (320, 225),
    (360, 640),
    (390, 844),
    (653, 360),
    (768, 1024),
    (844, 390),
    (1280, 800),
]
_MOVED = """async () => {
  const { Card } = await import('./board/card.js');
  const there = {
    status: 'there', name: 'Ada', colour: 'green', detail: '', invitations: 1, driven_by: null,
    lessons: 10, agreement: null, battery: null, busy: false, link: 'good', delay_ms: null,
    address: 'http://192.168.1.20:8000', stop: null, fault: null, asks_pilot: false, locks: [],
    emergency: false, stop_held_by: null,
  };
  const changes = [
    {}, { lessons: 0 }, { driven_by: 'pilot' }, { driven_by: 'robot' }, { asks_pilot: true },
    { emergency: true }, { stop_held_by: 'teacher' }, { stop: 'asked' }, { stop: 'not_reached' },
    { agreement: 0.97, delay_ms: 23 }, { agreement: 1, battery: 0.8, link: 'slow', delay_ms: 4321 },
    { agreement: 1, battery: 0.8, busy: true, delay_ms: 4321 },
    { fault: 'the camera sends nothing: check its plug, or the address of its stream' },
    ...['away', 'not_ours', 'no_class', 'connecting'].map((status) => (
      { status, detail: '[Errno 113] No route to host at robot-7.local:8000 (tried for 20 s)' })),
  ];
  const acts = { stop() {}, release() {}, open() {} };
  const cards = Array.from({ length: 6 }, (_, i) => new Card(1000 + i, acts));
  document.getElementById('robots').replaceChildren(...cards.map(({ element }) => element));
  const loud = document.getElementById('loud');
  const places = () => [...document.querySelectorAll('.halt, #bar .stop.shown')]
    .map((button) => button.getBoundingClientRect().top);
  const found = [];
  for (const showsCodes of [false, true]) {
    document.body.dataset.view = showsCodes ? 'codes' : 'pictures';
    for (const card of cards) card.show(there, showsCodes);
    const before = places();
    for (const change of changes) {
      cards[0].show({ ...there, ...change }, showsCodes);
      loud.textContent = change.stop === 'not_reached' ? 'Not reached: Ada, Bolt' : '';
      const most = Math.max(...places().map((top, i) => Math.abs(top - before[i])));
      const view = document.body.dataset.view;
      if (most > 1) found.push(`${view} ${JSON.stringify(change)}: ${most} px`);
    }
    loud.textContent = '';
  }
  return found;
}"""


@pytest.mark.parametrize("language", few(["es", "en", "zh"], 1))
def test_no_stop_moves_whatever_a_robot_says(chromium: Any, tmp_path: Path, language: str) -> None:
    with running_class(tmp_path) as here:
        context = chromium.new_context(locale=language, has_touch=True)
        page = context.new_page()
        page.goto(here.address)
        page.locator("#bar .stop.shown").wait_for()
        faults = []
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            faults += [f"{width}x{height}: {fault}" for fault in page.evaluate(_MOVED)]
        context.close()
    assert not faults, "\n".join(faults)
