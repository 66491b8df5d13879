"""The container image and the Pi's service run the program with options that it has.

A release builds the image and runs it (.github/workflows/release.yml).
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from server.cli.main import make_parser

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SERVICE = EXAMPLES / "raspberry-pi" / "drivelesson.service"
PROGRAM = "/opt/drivelesson/bin/drivelesson"


def parse(words: list[str]) -> Namespace:
    """Return the options of a command line, as the program reads them."""
    program, command, *options = words
    assert program == PROGRAM
    return make_parser(command, options).parse_args(options)


def test_the_image_runs_without_root_and_keeps_its_data_in_its_volume() -> None:
    text = (EXAMPLES / "container" / "Containerfile").read_text("utf-8")
    # if an option is repeated, the last one counts
    steps = dict(re.findall(r"^([A-Z]+) (.*)$", text, re.M))
    args = parse([*json.loads(steps["ENTRYPOINT"]), *json.loads(steps["CMD"])])
    assert args.lan and str(args.data) == steps["VOLUME"]
    uid, gid = steps["USER"].split(":")
    assert int(uid) > 0 and f"install -d -o {uid} -g {gid} {steps['VOLUME']}\n" in text


def test_systemd_accepts_the_service_and_finds_little_exposed(tmp_path: Path) -> None:
    if not shutil.which("systemd-analyze"):
        pytest.skip("THE SERVICE WAS NOT CHECKED: there is no systemd-analyze")
    unit = tmp_path / SERVICE.name
    unit.write_text(SERVICE.read_text("utf-8").replace(PROGRAM, sys.executable))
    checked = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True)
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")
    judging = ["systemd-analyze", "security", "--offline=true", "--threshold=25", unit]
    judged = subprocess.run(judging, capture_output=True, text=True)
    assert judged.returncode == 0, judged.stdout[-200:]


def test_the_service_drives_a_pi_with_options_that_the_program_has() -> None:
    lines = dict(re.findall(r"^(\w+)=(.*)$", SERVICE.read_text("utf-8"), re.M))
    args = parse(shlex.split(lines["ExecStart"].replace("%S", "/var/lib")))
    assert (args.robot, args.camera, args.lan) == ("gpio", "picamera2", True)
    assert str(args.data) == f"/var/lib/{lines['StateDirectory']}"
