"""Each picture of the docs is shown somewhere, and each shown picture exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_SHOWN = re.compile(r"""(?:src="|\]\()([^")\s]*images/[^")\s]+)""")


def test_pictures_are_shown_and_those_shown_are_there() -> None:
    shown = {
        (page.parent / name).resolve()
        for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))
        for name in _SHOWN.findall(page.read_text("utf-8"))
    }
    kept = set((ROOT / "docs" / "images").iterdir())
    assert shown == kept, f"{len(kept - shown)} are not shown, {len(shown - kept)} are missing"
    assert sum(path.stat().st_size for path in kept) < 5_000_000, "pictures stay small"
    film = ROOT / "docs" / "images" / "ten-seconds.webp"
    assert film in shown and film.stat().st_size < 2_000_000
