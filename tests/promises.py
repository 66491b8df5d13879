"""Lists which promise is tested at which level, and where: `python -m tests.promises [WORD ...]`.

A test's name is its promise. Its level follows from what it runs:

- parts: functions and objects, called directly;
- app: the served app with its loop, in virtual time;
- real: sockets, processes and threads on the wall clock;
- browser: Chromium before a server; full: only with DRIVELESSON_FULL=1 (`only_full`).

If the command line has words, only promises that contain one of the words are listed and counted.
"""

import argparse
import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
_SERVED = ("virtual", "virtual_server", "scenario", "classroom_world", "sessions")
"""Modules of tests that serve an app in virtual time."""


@dataclass(frozen=True, order=True)
class Promise:
    """The promise of one test."""

    file: str
    line: int
    text: str
    level: str

    def row(self) -> str:
        return f"| {self.text} | {self.level} | {self.file}:{self.line} |"


def promises(root: Path = HERE) -> Iterator[Promise]:
    """Yield the promise of each test, in the order of files and lines."""
    for path in sorted(root.rglob("test_*.py")):
        if "node_modules" not in path.parts:
            yield from sorted(_of(path, path.relative_to(root.parent).as_posix()))
    for path in sorted(root.glob("web/*.test.mjs")):
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            for quote in "'\"`":
                if line.startswith(f"test({quote}"):
                    text = line.split(quote)[1]
                    yield Promise(path.relative_to(root.parent).as_posix(), number, text, "parts")


def _of(path: Path, file: str) -> Iterator[Promise]:
    tree = ast.parse(path.read_text("utf-8"))
    imported = {
        name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in [(node.module or "").rpartition(".")[2], *(alias.name for alias in node.names)]
    }
    whole = [
        ast.unparse(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"
    ]
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name[:5] == "test_":
            marks = " ".join([*whole, *map(ast.unparse, node.decorator_list)])
            level = _level(file, marks, imported)
            yield Promise(file, node.lineno, node.name[5:].replace("_", " "), level)


def _level(file: str, marks: str, imported: set[str]) -> str:
    if file.startswith("tests/e2e/"):
        level = "browser"
    elif "realtime" in marks:
        level = "real"
    else:
        level = "app" if imported & {*_SERVED} else "parts"
    return f"{level}, full" if "only_full" in marks else level


def main() -> None:
    """Print the table, or the promises about some words."""
    parser = argparse.ArgumentParser(prog="python -m tests.promises", description=__doc__)
    parser.add_argument("words", nargs="*", help="only promises with one of these words")
    words = {word.lower() for word in parser.parse_args().words}
    found = [one for one in promises() if not words or words & {*one.text.lower().split()}]
    print("| promise | level | test |\n|---|---|---|")
    print("\n".join(one.row() for one in found))
    levels = Counter(one.level for one in found)
    print(f"\n{len(found)} promises:", ", ".join(f"{n} {level}" for level, n in levels.items()))


if __name__ == "__main__":
    main()
