"""Tests Drivelesson on Windows' Python under Wine: python -m tests.windows [PYTEST'S OPTIONS]"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from . import loop
from .python_for_windows import ROOT, environment, make, python

SUITE = ["tests/robot", "tests/server", "tests/contract"]
QUICK = "not slow and not browser"


def suite(words: list[str]) -> int:
    """Run the quick part of the suite under Wine; return the exit status."""
    options = ["-q", "-p", "no:cacheprovider", "-p", "tests.windows.skips", "-m", QUICK]
    is_named = any(Path(ROOT, word.partition("::")[0]).exists() for word in words)
    # The output comes through a pipe, because Wine cannot write to a file that is opened here.
    process = subprocess.Popen(
        python("-m", "pytest", *options, *words, *([] if is_named else SUITE)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**environment(), "PYTHONDONTWRITEBYTECODE": "1"},
        cwd=ROOT,
        text=True,
    )
    assert process.stdout is not None
    for line in process.stdout:
        print(line, end="", flush=True)
    return process.wait()


def main(words: list[str]) -> int:
    make()
    with tempfile.TemporaryDirectory() as name:
        loop.run(Path(name))
    return suite(words)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
