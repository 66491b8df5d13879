"""Prints the number of lines of each extension and package: `make extensions`.

A package here is a folder or a loose module directly in `robot` or `server`. `EXTENSIONS` lists the
extensions; everything else is the core.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from pathlib import Path

from . import rules

ROOT = Path(__file__).parents[2]
NEEDS: dict[str, tuple[str, ...]] = {
    "access": (),
    "board": ("access",),
    "bodies": ("devkit",),
    "challenge": (),
    "coaching": (),
    "adjustments": (),
    "devkit": (),
    "exchange": ("devkit", "recordings"),
    "integrations": (),
    "lab": ("simulator", "recordings", "exchange", "study"),
    "library": (),
    "recordings": (),
    "simulator": ("devkit",),
    "study": (),
    "testing": ("devkit",),
}
"""Each extension, and the extensions that it needs."""
EXTENSIONS = tuple(NEEDS)
WEB = {
    "access": ("pair",),
    "adjustments": ("js/adjustments",),
    "board": ("board", "js/board"),
    "bodies": ("eye",),
    "challenge": ("js/challenge",),
    "coaching": ("js/coaching",),
    "library": ("js/library",),
    "recordings": ("js/recordings",),
    "simulator": ("js/simulator",),
    "study": ("js/study",),
}
"""The folders of an extension in `web`."""
DOCUMENTS = {
    "access": ("howto/behind-a-proxy.md", "howto/phone.md"),
    "board": ("howto/class.md", "reference/board.md"),
    "bodies": (
        "howto/ev3.md",
        "howto/ev3-stock.md",
        "howto/gymnasium.md",
        "howto/lego-education.md",
        "howto/phone-eye.md",
        "howto/pybricks.md",
        "howto/ros.md",
    ),
    "exchange": ("howto/lerobot.md", "reference/imports.md"),
    "integrations": (),
    "lab": ("howto/try-an-idea.md", "reference/experiments.md"),
    "recordings": ("howto/episodes.md", "reference/episodes.md"),
    "simulator": ("reference/worlds.md",),
    "study": ("howto/run-a-study.md", "reference/study.md"),
}
"""The pages of an extension in `docs`."""
CORE_DOCUMENTS = (
    "howto/steer-by-degrees.md",
    "howto/use-from-python.md",
    "howto/write-a-driver.md",
    "reference/protocol.md",
)
"""Pages about the core only; the other pages name extensions, to say where they are."""
KINDS = ("code", "docstring", "comment", "blank")


def extension_of(file: Path) -> str:
    """Return the extension to which a module of the product belongs, by its path from the root."""
    return file.parts[1] if file.parts[1] in EXTENSIONS else "core"


def room_of(file: Path) -> str:
    """Return the package: a folder, or a loose module."""
    return "/".join(file.parts[:2]).removesuffix(".py")


def count_lines(text: str) -> Counter[str]:
    """Return the number of a module's lines of code, docstring, comment, and blank lines."""
    documented: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        for part in body:
            # A string that is a statement is a docstring; if it is not the first one, of an
            # attribute.
            if not (isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)):
                continue
            if isinstance(part.value.value, str):
                documented |= set(range(part.lineno, (part.end_lineno or part.lineno) + 1))
    found: Counter[str] = Counter()
    for number, line in enumerate(text.splitlines(), 1):
        if number in documented:
            found["docstring"] += 1
        elif not line.strip():
            found["blank"] += 1
        else:
            found["comment" if line.lstrip().startswith("#") else "code"] += 1
    return found


def count(root: Path) -> dict[str, dict[str, Counter[str]]]:
    """Return the lines by extension, package and kind."""
    found: dict[str, dict[str, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    for file in rules.modules(root):
        inner = file.relative_to(root)
        found[extension_of(inner)][room_of(inner)] += count_lines(file.read_text("utf-8"))
    return found


def render(root: Path) -> str:
    """Return the table."""
    counted = count(root)
    lines = [f"{'':28}{'all':>8}" + "".join(f"{kind:>11}" for kind in KINDS)]
    whole: Counter[str] = Counter()
    for extension in ("core", *EXTENSIONS):
        rooms = counted[extension]
        total = sum(rooms.values(), Counter())
        whole += total
        lines.append(_line(extension, total))
        lines += [_line(f"  {name}", rooms[name]) for name in sorted(rooms)]
    return "\n".join([*lines, _line("everything", whole)])


def _line(name: str, found: Counter[str]) -> str:
    return f"{name:28}{found.total():8}" + "".join(f"{found[kind]:11}" for kind in KINDS)


if __name__ == "__main__":
    print(render(ROOT))
