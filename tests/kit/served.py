"""Starts a server as people do, in a separate process."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def served(python: Path, folder: Path, *words: str, **environ: str) -> Iterator[str]:
    """Serve a robot, by default a simulated one, with a Python that has the program.

    Args:
        python: The interpreter.
        folder: The folder for the server's data and errors.
        words: Options of the command line.
        environ: Further variables of its environment.

    Yields:
        The server's address.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "stderr.txt"
    with log.open("w") as errors:
        process = subprocess.Popen(
            [python, "-m", "server", "--port", "0", "--data", folder / "data", *words],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1", **environ},
        )
    assert process.stdout is not None
    try:
        found = (re.search(r"open (http://\S+)", line) for line in process.stdout)
        address = next(filter(None, found), None)
        assert address is not None, f"the server did not start: {log.read_text()[-300:].strip()}"
        yield address[1]
    finally:
        process.terminate()
        process.communicate(timeout=60)
