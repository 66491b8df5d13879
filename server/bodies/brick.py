"""Install the server or the agent on a Lego Mindstorms EV3 over ssh, or examine an EV3."""

from __future__ import annotations

import argparse
import secrets
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import server
from robot.bodies.ev3 import installer
from robot.bodies.ev3.agent.wire import PORT
from robot.bodies.ev3.archive import Files, make_bundle
from robot.bodies.ev3.doctor import Level, examine, write_report
from robot.bodies.ev3.examination import measure
from robot.bodies.ev3.fake_agent import SECRET, fake_agent
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import secret_path
from robot.bodies.ev3.link import BrickLink
from robot.bodies.ev3.rootfs import (
    DEFAULT_RELEASE,
    PYTHON_VERSIONS,
    build_userland,
    precompile,
    userland_stamp,
)
from robot.bodies.ev3.scripts import AGENT_SCRIPT, INSTALL_SCRIPT, START_SCRIPT, UNIT
from robot.errors import ConfigurationError, quoted
from robot.store.folder import default_root, write_whole
from server.cli.parser import whole
from server.config import Config

CONSENT = (
    "The wheels will turn for ten seconds. Lift the robot, then press Enter; or type n to skip "
    "this: "
)
PYTHON_FOLDERS = ("usr/lib/python3.*", "usr/lib/python3/dist-packages")


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    add(
        "what",
        choices=("agent", "install", "pack", "doctor"),
        help="start the agent on the brick, install or pack the server, or examine the brick",
    )
    add(
        "address",
        nargs="?",
        help="the brick's address, such as robot@ev3dev.local (for install: root@...); for pack, "
        "the file to write",
    )
    add("--port", type=whole(1, 65535), default=PORT, help=f"the agent's port{shown}")
    add(
        "--keep",
        type=Path,
        default=default_root() / "brick",
        help=f"folder in which the brick's Debian is built and kept{shown}",
    )
    add(
        "--release",
        default=DEFAULT_RELEASE,
        choices=tuple(PYTHON_VERSIONS),
        help=f"Debian release for the brick{shown}",
    )
    add("--mirror", default="", help="address of a Debian mirror (default: this machine's own)")
    add("--from", dest="packed", type=Path, help="install: the file that pack wrote")
    add(
        "--autostart",
        action="store_true",
        help="also start the agent each time that the brick boots (asks for the brick's password)",
    )
    add("--fake", action="store_true", help="doctor: examine a simulated brick")
    add("--yes", action="store_true", help="doctor: turn the wheels without asking")
    add("--script", action="store_true", help="only print the script for the brick")


def run(args: argparse.Namespace) -> int:
    if args.what == "doctor":
        return _examine(args)
    if args.script:
        print(AGENT_SCRIPT if args.what == "agent" else INSTALL_SCRIPT)
        return 0
    if not args.address:
        raise ConfigurationError(
            "name the file to write: drivelesson brick pack FILE"
            if args.what == "pack"
            else f"name the brick: drivelesson brick {args.what} ADDRESS"
        )
    if args.what == "pack":
        return _pack(args)
    if shutil.which("ssh") is None:
        raise ConfigurationError(
            "ssh is not installed; on Debian and Ubuntu: apt install openssh-client"
        )
    return _start_agent(args) if args.what == "agent" else _install(args)


def _start_agent(args: argparse.Namespace) -> int:
    target = args.address if "@" in args.address else f"robot@{args.address}"
    host = target.partition("@")[2]
    secret = _shared_secret(host)
    print(installer.start_agent(target, secret, args.port))
    if args.autostart:
        installer.start_with_the_brick(target)
    print(
        f"Drive with: drivelesson serve --robot ev3-remote --brick {host}"
        + (f":{args.port}" if args.port != PORT else "")
    )
    return 0


def _shared_secret(host: str) -> str:
    """Return the secret that this machine shares with a brick; the first call makes it."""
    file = secret_path(host)
    if not file.exists():
        write_whole(file, f"{secrets.token_urlsafe(16)}\n".encode(), mode=0o600)
    return file.read_text().strip()


def _install(args: argparse.Namespace) -> int:
    target = args.address if "@" in args.address else f"root@{args.address}"
    if args.packed is not None:
        print("copying, which takes some minutes over Wi-Fi ...", flush=True)
        print(installer.install_packed(target, args.packed))
        return 0
    is_there = installer.installed_packages(target) == userland_stamp(args.release)
    files = _build(args, with_userland=not is_there)
    print("copying, which takes some minutes over Wi-Fi ...", flush=True)
    print(installer.run_on_brick(target, INSTALL_SCRIPT, files))
    return 0


def _pack(args: argparse.Namespace) -> int:
    file = Path(args.address)
    installer.pack(file, _build(args, with_userland=True))
    print(
        f"packed {file} ({file.stat().st_size / 1e6:.0f} MB); install it, now or later, with\n"
        f"  drivelesson brick install root@ADDRESS --from {quoted(str(file))}\n"
        "or without Drivelesson:\n"
        f'  ssh root@ADDRESS "$(tar -xOf {file} install)" <{file}'
    )
    return 0


def _build(args: argparse.Namespace, *, with_userland: bool) -> Files:
    args.keep.mkdir(parents=True, exist_ok=True)
    userland = args.keep / f"root-{args.release}"
    compiled = _make_userland(userland, args) if with_userland else True
    program = args.keep / "program/opt/drivelesson"
    print("packing the program ...", flush=True)
    make_bundle(program, Path(server.__path__[0]), Config().web)
    ahead = precompile(args.keep / "program", ("opt/drivelesson",), args.release)
    return [
        ("program", program),
        ("start", START_SCRIPT.encode()),
        ("drivelesson.service", UNIT.encode()),
        ("packages", userland_stamp(args.release).encode()),
        *([("root", userland)] if with_userland else []),
        *([("compiled", b"")] if compiled and ahead else []),
    ]


def _make_userland(folder: Path, args: argparse.Namespace) -> bool:
    """Build the brick's Debian unless it exists; return True if its Python files are compiled."""
    stamp, wanted = folder.with_name(folder.name + ".packages"), userland_stamp(args.release)
    if not (stamp.is_file() and stamp.read_text() == wanted):
        print("building Debian for the brick, which takes a minute ...", flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        build_userland(folder, args.release, args.mirror)
        stamp.write_text(wanted)
    return precompile(folder, PYTHON_FOLDERS, args.release)


def _examine(args: argparse.Namespace) -> int:
    """Examine a brick and print the report; return 1 if something is wrong."""
    if args.fake:
        with (
            tempfile.TemporaryDirectory() as folder,
            FakeBrick(Path(folder, "brick")) as brick,
            fake_agent(brick) as address,
        ):
            furnish(brick)
            return examine_at(address, SECRET, lambda: True)
    if not args.address:
        raise ConfigurationError("name the brick: drivelesson brick doctor ADDRESS, or use --fake")
    host = args.address.rpartition("@")[2]
    address = host if ":" in host else f"{host}:{args.port}"
    return examine_at(address, "", lambda: args.yes or ask_consent())


def examine_at(address: str, secret: str, may_turn_wheels: Callable[[], bool]) -> int:
    """Examine the brick at an address and print the report; return 1 if something is wrong."""
    print(f"examining the brick at {address.partition(':')[0]}, for about half a minute ...\n")
    findings = examine(measure(BrickLink(address, secret), may_turn_wheels))
    print(write_report(findings))
    return int(any(finding.level is Level.WRONG for finding in findings))


def ask_consent() -> bool:
    """Ask on the terminal whether the wheels may turn; the end of input means no."""
    try:
        return input(CONSENT).strip().lower() in ("", "y", "yes")
    except EOFError:
        return False


def furnish(brick: FakeBrick) -> None:
    brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
    for port in ("in1", "in2"):
        brick.add_sensor(port, "lego-ev3-touch", 0)
