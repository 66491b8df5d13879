"""The container image and the Pi's service, as far as a machine without Podman and Pi can test
them.

The steps of the Containerfile run in a separate root folder, and then its command: without root and
capabilities, and with only /data to write to. A pupil teaches that robot.
"""

from __future__ import annotations

import contextlib
import json
import os
import posixpath
import re
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.cli.main import make_parser
from tests.kit.sizes import only_full
from tests.server.live_robot import Pilot

from .test_class_command import free_ports

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
SERVICE = EXAMPLES / "raspberry-pi" / "drivelesson.service"
PROGRAM = "/opt/drivelesson/bin/drivelesson"
LIBRARY = '"$ROOT"/opt/drivelesson/lib/python*/site-packages'
HERE = f"{sys.base_prefix}/bin:/usr/sbin:/usr/bin:/sbin:/bin"
# The machine's replacement for the base image: programs and libraries, Python, and the packages
# that pip would fetch.
LENT = ["/usr", "/etc", "/proc", "/dev", sys.base_prefix]
BEGIN = """
set -eu
mount --make-rprivate /
mount -t tmpfs none "$ROOT"
for place in bin sbin lib lib64; do [ ! -L /$place ] || cp -a /$place "$ROOT/$place"; done
lend() { mkdir -p "$ROOT$2"; mount --rbind "$1" "$ROOT$2"; }
mkdir -p "$ROOT/tmp" "$ROOT/opt"
inside() { chroot "$ROOT" env -i PATH="$PATH" "$@"; }
"""
SEAL = """
umount -R "$ROOT/clone"
mount -o remount,ro "$ROOT"
mount -t tmpfs none "$ROOT/tmp"
mount --bind "$DATA" "$ROOT/data"
"""
NOBODY = ["--clear-groups", "--no-new-privs", "--inh-caps=-all", "--bounding-set=-all"]


def steps(text: str) -> list[tuple[str, str]]:
    """Return the instructions of a Containerfile with their arguments."""
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    found = [line.split(" ", 1) for line in lines]
    return [(word, rest) for word, rest in found]


def image_script(asked: list[str]) -> str:
    """Return a shell script that executes the Containerfile's steps, and runs its command."""
    text = (EXAMPLES / "container" / "Containerfile").read_text("utf-8")
    script, environment, user, command = [BEGIN], ["LANG=C.UTF-8"], "0:0", []
    script += [f"lend {shlex.quote(place)} {shlex.quote(place)}" for place in LENT]
    script.append(f"lend {shlex.quote(str(ROOT))} /clone")
    script.append(f"lend {shlex.quote(sysconfig.get_path('purelib'))} /packages")
    # pip uses these packages, and downloads nothing.
    pip = (
        "PIP_NO_DEPS=1 PIP_NO_BUILD_ISOLATION=false PIP_NO_INDEX=1 PIP_DISABLE_PIP_VERSION_CHECK=1"
    )
    for word, rest in steps(text):
        if word == "RUN" and "apt-get" not in rest:
            script.append(f"inside {pip} sh -ec {shlex.quote(rest)}")
            if "-m venv" in rest:
                script.append(f"for p in {LIBRARY}; do echo /packages > $p/lent.pth; done")
        elif word == "COPY" and not rest.startswith("--from"):
            *sources, target = shlex.split(rest)
            taken = " ".join(f"/clone/{source}" for source in sources)
            above = posixpath.dirname(target)
            script.append(f"mkdir -p $ROOT{above}; inside cp -r {taken} {target}")
        elif word == "ENV":
            environment += shlex.split(rest)
        elif word == "USER":
            user = rest
        elif word in ("ENTRYPOINT", "CMD"):
            command += json.loads(rest)
    uid, gid = user.split(":")
    assert int(uid) > 0, "the image runs without root"
    as_nobody = ["setpriv", "--reuid", uid, "--regid", gid, *NOBODY, "env", "-i", *environment]
    run = ["chroot", '"$ROOT"', *map(shlex.quote, as_nobody)]
    tries = "for p in / /opt /opt/drivelesson /etc; do ! touch $p/x 2>/dev/null || exit 9; done"
    script += [
        SEAL,
        f'chown {user} "$DATA"',
        " ".join([*run, "sh", "-c", shlex.quote(tries)]),
    ]
    script.append(" ".join(["exec", *run, *map(shlex.quote, [*command, *asked])]))
    return "\n".join(script)


@contextlib.contextmanager
def contained(tmp_path: Path, port: int) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """Run the image's command inside the block; yield the process, and the folder of /data."""
    if os.geteuid() or not shutil.which("unshare") or not shutil.which("setpriv"):
        pytest.skip("THE IMAGE WAS NOT TRIED: its root folder needs root, unshare and setpriv")
    root, data = tmp_path / "root", tmp_path / "data"
    root.mkdir()
    data.mkdir()
    script = image_script(["--host", "127.0.0.1", "--port", str(port)])
    process = subprocess.Popen(
        ["unshare", "--mount", "sh", "-c", script],
        env={"PATH": HERE, "ROOT": str(root), "DATA": str(data)},
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        try:
            yield process, data
        finally:
            process.kill()


@only_full
@pytest.mark.timeout(600)
def test_the_image_drives_without_root_and_writes_only_its_data(tmp_path: Path) -> None:
    (port,) = [free_ports(1)]
    with contained(tmp_path, port) as (process, data):
        assert process.stdout is not None
        said = iter(process.stdout.readline, "")
        codes = (re.search(r"(http://\S+?)/pair#(\S+)", line) for line in said)
        found = next(filter(None, codes), None)
        assert found is not None, "it says how to pair a phone"
        address, token = f"http://127.0.0.1:{port}", found[2]
        status = Path(f"/proc/{process.pid}/status").read_text()
        assert re.search(r"^Uid:\t10001\t10001\t", status, re.M), status
        for held in ("CapEff", "CapPrm", "CapBnd", "CapInh"):
            assert re.search(rf"^{held}:\t0+$", status, re.M), held
        with httpx.Client(base_url=address, headers={"origin": address}) as phone:
            phone.post("/api/pair", json={"token": token}).raise_for_status()
            assert "<html" in phone.get("/").text
            cookie = "; ".join(f"{name}={value}" for name, value in phone.cookies.items())
        url, headers = address.replace("http", "ws", 1) + "/ws/drive", {"Cookie": cookie}
        with Pilot(url, sees=True, additional_headers=headers, origin=address) as pilot:
            pilot.drive_until(lambda: pilot.state["lessons"] >= 10)
            pilot.mode("stopped")
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
        assert list(data.glob("models/*/*.npz")), "what was taught is in /data"


def unit_lines(text: str) -> dict[str, str]:
    """Return the settings of a unit by name."""
    return dict(re.findall(r"^(\w+)=(.*)$", text, re.M))


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


def test_the_service_uses_options_that_the_program_has() -> None:
    lines = unit_lines(SERVICE.read_text("utf-8"))
    program, *words = shlex.split(lines["ExecStart"].replace("%S", "/var/lib"))
    assert program == PROGRAM
    command, *options = words
    args = make_parser(command, options).parse_args(options)
    assert (args.robot, args.camera, args.lan) == ("gpio", "picamera2", True)
    assert str(args.data) == f"/var/lib/{lines['StateDirectory']}"
