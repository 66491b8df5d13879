"""Tries a wheel as a new user does, in a fresh environment: `make dist` runs it, and CI on every
system.

    python tests/docs/try_wheel.py FOLDER_WITH_THE_WHEEL

The script needs only Python: the wheel is installed with its requirements, prints its version, runs
the README's lines, and serves the page beside a simulated robot.
"""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
import venv
from pathlib import Path

README = Path(__file__).resolve().parents[2] / "README.md"
PATIENCE_S = 180


def main(folder: Path) -> None:
    (wheel,) = folder.resolve().glob("drivelesson-*.whl")
    # Windows may keep a file open for a moment after its program has ended.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        place = Path(name)
        venv.create(place / "venv", with_pip=True)
        programs = place / "venv" / ("Scripts" if sys.platform == "win32" else "bin")
        python, drivelesson = programs / "python", programs / "drivelesson"
        subprocess.run([python, "-m", "pip", "install", "--quiet", wheel], check=True)
        version = wheel.name.split("-")[1]
        said = subprocess.run(
            [drivelesson, "--version"], capture_output=True, text=True, check=True
        )
        assert version in said.stdout, said.stdout
        (code,) = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
        done = subprocess.run(
            [python, "-c", code], cwd=place, capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == ["left"], done.stdout
        _serve(drivelesson, place)
    print(f"{wheel.name} works on {sys.platform} with Python {sys.version.split()[0]}")


def _serve(drivelesson: Path, place: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [drivelesson, "--port", str(port), "--data", str(place / "data")]
    with subprocess.Popen(command, cwd=place) as server:
        try:
            health = json.loads(_get(f"http://127.0.0.1:{port}/healthz"))
            assert health["status"] == "ok", health
            assert b"<html" in _get(f"http://127.0.0.1:{port}/").lower()
        finally:
            server.terminate()


def _get(address: str) -> bytes:
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            with urllib.request.urlopen(address, timeout=10) as answer:
                return bytes(answer.read())
        except OSError:
            if time.monotonic() > until_s:
                raise
            time.sleep(0.5)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
