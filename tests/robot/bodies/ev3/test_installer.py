"""`drivelesson brick`: the real scripts in a real shell; ssh and systemctl are stand-ins."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import secret_path
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.ev3.rootfs import build_userland
from robot.errors import ConfigurationError
from server.__main__ import main
from server.bodies import brick as command
from tests.kit.ports import free_port

SSH = """
while [ "${1#-}" != "$1" ]; do [ "$1" = -o ] && shift; shift; done
echo "$1" >>"$FAKE_HOME/targets"
shift
cd "$FAKE_HOME" && exec sh -c "$*"
"""


@pytest.fixture
def far_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A brick's home folder, which a stand-in for ssh reaches."""
    tools, home = tmp_path / "tools", tmp_path / "home"
    for folder in (tools, home):
        folder.mkdir()
    for name, text in (
        ("ssh", SSH),
        ("systemctl", '[ $1 = is-active ] && exit 3\necho "$@" >>"$FAKE_HOME/systemctl"\n'),
        ("sudo", 'exec "$@"\n'),
        ("id", "echo 0\n"),
    ):
        (tools / name).write_text("#!/bin/sh\n" + text)
        (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:{Path(sys.executable).parent}:{os.environ['PATH']}")
    for name in ("FAKE_HOME", "DRIVELESSON_PREFIX"):
        monkeypatch.setenv(name, str(home))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return home


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """The release and mirror of each build; `make test-brick` builds real userlands."""
    made: list[tuple[str, str]] = []

    def build(folder: Path, release: str, mirror: str) -> None:
        made.append((release, mirror))
        (folder / "usr/lib/python3").mkdir(parents=True)
        (folder / "usr/lib/python3/this.py").write_text("print('here')\n")

    monkeypatch.setattr(command, "build_userland", build)
    monkeypatch.setattr(command, "precompile", lambda root, folders, release: True)
    return made


@pytest.fixture
def agent_pid(far_home: Path) -> Iterator[Path]:
    file = far_home / "drivelesson/agent.pid"
    yield file
    if file.exists():
        os.kill(int(file.read_text()), signal.SIGTERM)


@pytest.mark.realtime
def test_the_agent_is_copied_and_started_twice_and_again_when_it_dies(
    far_home: Path,
    agent_pid: Path,
    real_brick: FakeBrick,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("DRIVELESSON_ROOT", str(real_brick.root))
    port = free_port()
    assert main(["brick", "agent", "127.0.0.1", "--port", str(port)]) == 0
    first = agent_pid.read_text()
    assert main(["brick", "agent", "127.0.0.1", "--port", str(port)]) == 0
    assert agent_pid.read_text() != first, "a new agent has replaced the old one"
    assert (far_home / "targets").read_text().split() == ["robot@127.0.0.1"] * 2
    assert f"--brick 127.0.0.1:{port}" in capsys.readouterr().out
    assert secret_path("127.0.0.1").stat().st_mode & 0o077 == 0
    options = Ev3RemoteOptions(brick=f"127.0.0.1:{port}")
    with Ev3RemoteDriver(options) as driver:
        assert driver.is_connected, "the saved secret is valid"
    log = far_home / "drivelesson/agent.log"
    starts = log.read_text().count("listening")
    keeper = agent_pid.read_text().strip()
    os.kill(
        int(Path(f"/proc/{keeper}/task/{keeper}/children").read_text().split()[0]), signal.SIGKILL
    )
    real_brick.wait_until(lambda: log.read_text().count("listening") == starts + 1, 60)
    assert "ended with status 137; restarting it" in log.read_text()
    with Ev3RemoteDriver(options) as driver:
        assert driver.is_connected


def test_the_brick_starts_the_agent_by_itself(
    far_home: Path, agent_pid: Path, brick: FakeBrick, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = free_port()
    monkeypatch.setenv("DRIVELESSON_ROOT", str(brick.root))
    assert main(["brick", "agent", "127.0.0.1", "--port", str(port), "--autostart"]) == 0
    unit = (far_home / "etc/systemd/system/drivelesson-agent.service").read_text()
    assert f"ExecStart=/bin/sh {far_home}/drivelesson/keep-agent" in unit
    assert "Restart=always" in unit
    assert "Conflicts=drivelesson.service" in unit
    assert (far_home / "systemctl").read_text() == (
        "daemon-reload\ndisable --now drivelesson\nenable drivelesson-agent\n"
        "restart drivelesson-agent\n"
    )
    agent_pid.unlink()  # the stand-in for systemd starts no service


def test_an_agent_that_cannot_start_says_why(
    far_home: Path, agent_pid: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("0.0.0.0", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["brick", "agent", "127.0.0.1", "--port", port]) == 1
    agent_pid.unlink()
    error = capsys.readouterr().err
    assert "could not be set up" in error
    assert f"cannot use port {port}" in error
    assert error.count("\n") == 1


def test_installing_is_safe_to_repeat(
    far_home: Path,
    tmp_path: Path,
    builds: list[tuple[str, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = far_home / "opt/drivelesson"
    packages, program = there / "packages", there / "root/opt/drivelesson"
    monkeypatch.setattr(
        command.installer,
        "installed_packages",
        lambda target: packages.read_text() if packages.exists() else "",
    )
    words = ["brick", "install", "10.0.0.9", "--keep", str(tmp_path / "keep")]
    assert main(words) == 0
    for part in ("robot/bodies/ev3/agent/body.py", "ev3dev2/__init__.py", "server/web/index.html"):
        assert (program / part).is_file()
    plugins = next(program.glob("*.dist-info/entry_points.txt")).read_text()
    assert "ev3 = robot.bodies.ev3.driver" in plugins
    config = far_home / "etc/drivelesson.toml"
    config.write_text("left_port = 'outA'\n")
    (program / "robot/left_over.py").touch()
    assert main(words) == 0
    assert len(builds) == 1
    assert config.read_text() == "left_port = 'outA'\n"
    assert not (program / "robot/left_over.py").exists()
    assert (there / "root/usr/lib/python3/this.py").is_file()
    assert not (there / "incoming").exists()
    assert (far_home / "systemctl").read_text().count("restart drivelesson") == 2
    unit = (far_home / "etc/systemd/system/drivelesson.service").read_text()
    assert "python3 -OO -m server.bodies.lean serve --robot ev3" in unit
    assert os.access(there / "start", os.X_OK)


def test_an_unreachable_brick_is_reported_in_one_line(
    far_home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "tools/ssh").write_text("#!/bin/sh\necho 'ssh: No route to host' >&2\nexit 255\n")
    assert main(["brick", "agent", "10.0.0.9"]) == 1
    error = capsys.readouterr().err
    assert "robot@10.0.0.9 could not be set up: ssh: No route to host" in error
    assert main(["brick", "install"]) == 2
    assert "name the brick" in capsys.readouterr().err
    assert main(["brick", "install", "--script"]) == 0
    assert "systemctl enable drivelesson" in capsys.readouterr().out
    with pytest.raises(ConfigurationError, match="sid is not supported; choose one of: bookworm"):
        build_userland(Path("nowhere"), "sid")


def test_a_packed_server_is_installed_without_building_anything(
    far_home: Path,
    tmp_path: Path,
    builds: list[tuple[str, str]],
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "brick.tar"
    mirror = ["--release", "trixie", "--mirror", "http://mirror.example/debian"]
    assert main(["brick", "pack", str(file), *mirror, "--keep", str(tmp_path / "keep")]) == 0
    assert f"install root@ADDRESS --from {file}" in capsys.readouterr().out
    assert main(["brick", "install", "10.0.0.9", "--from", str(file)]) == 0
    assert builds == [("trixie", "http://mirror.example/debian")], "only `pack` builds the root"
    there = far_home / "opt/drivelesson"
    assert (there / "root/usr/lib/python3/this.py").is_file()
    assert (there / "packages").read_text().startswith("trixie python3 ")
    (there / "root/usr/lib/python3/this.py").unlink()
    subprocess.run(  # the command of the message must work without an installed Drivelesson
        f'ssh root@ADDRESS "$(tar -xOf {file} install)" <{file}', shell=True, check=True
    )
    assert (there / "root/usr/lib/python3/this.py").is_file()


@pytest.mark.parametrize("content", [b"no tar at all", None])
def test_a_file_that_pack_did_not_make_is_reported_in_one_line(
    far_home: Path, tmp_path: Path, content: bytes | None, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "brick.tar"
    if content is not None:
        file.write_bytes(content)
    assert main(["brick", "install", "10.0.0.9", "--from", str(file)]) == 2
    error = capsys.readouterr().err
    assert str(file) in error
    assert error.count("\n") == 1
    assert not (far_home / "opt").exists()
