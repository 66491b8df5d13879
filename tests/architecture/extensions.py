"""Prints the number of lines of each extension and package: `make extensions`.

A package here is a folder or a loose module directly in `robot` or `server`. `EXTENSIONS` lists the
extensions; everything else is the core.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("robot", "server")
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
CORE_DOCUMENTS = (
    "howto/proportional-steering.md",
    "howto/use-from-python.md",
    "howto/write-a-driver.md",
    "reference/protocol.md",
)
"""Pages that may name no extension; all other pages say where extensions are."""


def modules(root: Path) -> list[Path]:
    """Return the modules of the product."""
    return sorted(file for package in PACKAGES for file in (root / package).rglob("*.py"))


def extension_of(file: Path) -> str:
    """Return the extension that contains a module, by the module's path from the root."""
    return file.parts[1] if file.parts[1] in EXTENSIONS else "core"


def render(root: Path) -> str:
    """Return the table: the lines of each extension, and of its packages."""
    counted: dict[str, Counter[str]] = defaultdict(Counter)
    for file in modules(root):
        inner = file.relative_to(root)
        room = "/".join(inner.parts[:2]).removesuffix(".py")
        counted[extension_of(inner)][room] += len(file.read_text("utf-8").splitlines())
    lines = []
    for extension in ("core", *EXTENSIONS):
        rooms = counted[extension]
        lines.append(f"{extension:28}{rooms.total():8}")
        lines += [f"  {name:26}{rooms[name]:8}" for name in sorted(rooms)]
    total = sum(rooms.total() for rooms in counted.values())
    return "\n".join([*lines, f"{'everything':28}{total:8}"])


if __name__ == "__main__":
    print(render(ROOT))
