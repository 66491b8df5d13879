"""Put the server, or only the agent, on a Lego Mindstorms EV3, over ssh."""

from __future__ import annotations

import argparse
import secrets
import shutil
from pathlib import Path

import server
from robot.brick import installer
from robot.brick.agent.wire import PORT
from robot.brick.bundle import make_bundle
from robot.brick.handshake import secret_path
from robot.brick.rootfs import build_userland, precompile
from robot.errors import ConfigurationError
from robot.storage.folder import default_root
from server.cli.parser import whole
from server.config import Config

PYTHON_FOLDERS = ("usr/lib/python3.11", "usr/lib/python3/dist-packages")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare what can be done, and where."""
    parser.add_argument("what", choices=("agent", "install"), help="what to put on the brick")
    parser.add_argument(
        "address", nargs="?", help="the brick: robot@ev3dev.local, or root@... to install"
    )
    parser.add_argument(
        "--port", type=whole(1, 65535), default=PORT, help="the agent's port (default: %(default)s)"
    )
    parser.add_argument(
        "--keep",
        type=Path,
        default=default_root() / "brick",
        help="folder where the brick's Debian is kept (default: %(default)s)",
    )
    parser.add_argument(
        "--autostart",
        action="store_true",
        help="have the brick start the agent whenever it starts (asks for the brick's password)",
    )
    parser.add_argument(
        "--script", action="store_true", help="only print what would run on the brick"
    )


def run(args: argparse.Namespace) -> int:
    """Do it, or print the script."""
    if args.script:
        print(installer.AGENT_SCRIPT if args.what == "agent" else installer.INSTALL_SCRIPT)
        return 0
    if not args.address:
        raise ConfigurationError(f"which brick? drivelesson brick {args.what} ADDRESS")
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
    """Return the secret that this machine shares with a brick; make one at the first time."""
    file = secret_path(host)
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch(mode=0o600)
        file.write_text(secrets.token_urlsafe(16) + "\n")
    return file.read_text().strip()


def _install(args: argparse.Namespace) -> int:
    target = args.address if "@" in args.address else f"root@{args.address}"
    is_there = installer.installed_packages(target) == installer.packages_stamp()
    userland = args.keep / "root"
    args.keep.mkdir(parents=True, exist_ok=True)
    compiled = True
    if not is_there:
        compiled = _make_userland(userland)
    program = args.keep / "program/opt/drivelesson"
    print("packing the program ...", flush=True)
    make_bundle(program, Path(server.__path__[0]), Config().web_folder)
    compiled = precompile(args.keep / "program", ("opt/drivelesson",)) and compiled
    print("copying, which takes some minutes over Wi-Fi ...", flush=True)
    print(installer.install(target, program, None if is_there else userland, compiled=compiled))
    return 0


def _make_userland(folder: Path) -> bool:
    """Build the brick's Debian unless that was done; return whether it is compiled ahead."""
    stamp = folder.with_name("packages")
    if not (stamp.is_file() and stamp.read_text() == installer.packages_stamp()):
        print("building the brick's Debian, which takes a minute ...", flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        build_userland(folder)
        stamp.write_text(installer.packages_stamp())
    return precompile(folder, PYTHON_FOLDERS)
