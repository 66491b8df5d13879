"""The page's source uses only features of browsers from the end of 2020 (docs/howto/page.md).

The TypeScript compiler checks the standard library, with the `lib` of ES2021 (tsconfig.json). The
tests in this file check syntax, browser features and styles.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from server.config import Config

WEB = Config().web
APART = ("sw.js", "board/", "eye/")
"""The service worker is optional; the teacher's board and the eye are for newer browsers."""
PAGE = sorted(
    path for path in WEB.rglob("*.js") if not path.relative_to(WEB).as_posix().startswith(APART)
)
STYLES = [WEB / "css" / name for name in ("base.css", "drive.css")]

SYNTAX = {
    "await outside of a function (Chrome 89, Safari 15)": r"^await |^\}? ?await ",
    "a private field (Safari 14.1)": r"[.\s{]#[a-z]\w*\s*[=;(]",
    "a static field (Safari 14.1)": r"^\s+static \w+ =",
    "looking behind in a pattern (Safari 16.4)": r"\(\?<[=!]",
    "a class's static block (Safari 16.4)": r"^\s+static \{",
}
OFFERED = {
    "createImageBitmap": "Safari 15",
    "showPopover": "Chrome 114",
    "transferControlToOffscreen": "Firefox 105, Safari 17",
    "getCoalescedEvents": "Safari 17",
    "requestVideoFrameCallback": "Firefox 132, Safari 15.4",
    "checkVisibility": "Chrome 105",
    "structuredClone": "Chrome 98",
    "randomUUID": "Chrome 92",
    "requestIdleCallback": "no Safari",
    "setHTMLUnsafe": "Chrome 124",
    "startViewTransition": "Chrome 111",
}
"""Features that a file uses only after it has checked that they exist."""
STYLED = {
    "inset": r"[;{ ]inset:(?! auto;)",
    "a container": r"@container|container(-type)?:",
    ":has, :is, :where": r":(has|is|where)\(",
    "aspect-ratio": r"(?<!min-)aspect-ratio:",
    "a small, large or dynamic height": r"(?<!\(height: 100)\b\d+[dsl]vh",
    "color-mix": r"color-mix\(",
    "nesting": r"&[ .:]",
    "a layer": r"@layer",
}


@pytest.mark.parametrize("path", PAGE, ids=lambda path: path.relative_to(WEB).as_posix())
def test_scripts_keep_to_the_baseline(path: Path) -> None:
    text = re.sub(r"(?<!:)//.*", "", path.read_text())
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = [what for what, pattern in SYNTAX.items() if re.search(pattern, text, re.MULTILINE)]
    for name, since in OFFERED.items():
        asked = rf"'{name}' in|\.{name}\?\.|!?\w+\.{name}\b *(\)|\|\||&&|\?)|\.{name};|{name}\) "
        if re.search(rf"\b{name}\b", text) and not re.search(asked, text):
            found.append(f"{name} ({since}) is used, and not asked for")
    assert found == []


@pytest.mark.parametrize("path", STYLES, ids=lambda path: path.name)
def test_the_drive_screens_styles_keep_to_the_baseline(path: Path) -> None:
    text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
    text = re.sub(r"@supports [^{]*\{[^{}]*\{[^}]*\}\s*\}", "", text)
    for what, pattern in STYLED.items():
        found = re.search(pattern, text)
        assert found is None, f"{what}: {found and text[found.start() - 40 : found.end()]!r}"


def test_the_first_script_is_for_any_browser() -> None:
    """This file must also run in old browsers, because it tells them that they are too old."""
    [script] = re.findall(r"<script>(.*?)</script>", (WEB / "index.html").read_text(), re.DOTALL)
    code = re.sub(r"'[^']*'|//.*|/\*.*?\*/", "", script)
    for newer in (r"=>", r"\b(let|const|class|async|await)\b", "`", r"\?\.|\?\?", r"\.\.\."):
        assert not re.search(newer, code), newer
