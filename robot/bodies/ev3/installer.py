"""Runs scripts on a brick over ssh, and sends them their files."""

from __future__ import annotations

import subprocess
import tarfile
from pathlib import Path
from tempfile import TemporaryFile

from robot.bodies.ev3.archive import Files, make_agent, write_tar
from robot.bodies.ev3.scripts import AGENT_SCRIPT, AUTOSTART_SCRIPT, INSTALL_SCRIPT, KEEP_SCRIPT
from robot.errors import ConfigurationError, DriveError, told_as
from robot.store.folder import whole_file


def run_on_brick(target: str, script: str, files: Files | Path) -> str:
    """Run a script on the brick, with files or a tar file on its standard input; return its output.
    Raises DriveError, with the last line of output, if ssh or the script fails."""
    with files.open("rb") if isinstance(files, Path) else TemporaryFile() as stream:
        if not isinstance(files, Path):
            write_tar(stream, files)
            stream.seek(0)
        done = subprocess.run(
            ["ssh", "-o", "ConnectTimeout=10", target, script],
            stdin=stream,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
    output = done.stdout.strip()
    if done.returncode != 0:
        last = output.splitlines()[-1:] or ["no output"]
        raise DriveError(f"the brick at {target} could not be set up: {last[0]}")
    return output


def start_agent(target: str, secret: str, port: int) -> str:
    """Copy the agent to a brick with the stock image and start it; idempotent."""
    files = [
        ("agent.pyz", make_agent()),
        ("keep-agent", KEEP_SCRIPT.replace("@PORT@", str(port)).encode()),
        ("autostart", AUTOSTART_SCRIPT.encode()),
        ("secret", secret.encode()),
    ]
    return run_on_brick(target, AGENT_SCRIPT, files)


def start_with_the_brick(target: str) -> None:
    """Let the brick start the agent at each boot; sudo may ask for the password."""
    sudo = "" if target.startswith("root@") else "sudo "
    done = subprocess.run(
        ["ssh", "-t", "-o", "ConnectTimeout=10", target, sudo + "sh drivelesson/autostart"],
        check=False,
    )
    if done.returncode != 0:
        raise DriveError(
            f"the brick at {target} could not be set up to start the agent at boot; "
            "try on the brick: sudo sh drivelesson/autostart"
        )


def installed_packages(target: str) -> str:
    """Return the names of the brick's Debian release and packages; empty if the server is not
    installed."""
    return run_on_brick(
        target, "cat >/dev/null; cat /opt/drivelesson/packages 2>/dev/null || true", []
    )


def pack(file: Path, files: Files) -> None:
    """Write everything that a brick needs to one file, which begins with the installation
    script."""
    with told_as(ConfigurationError, f"cannot write {file}"), whole_file(file) as stream:
        write_tar(stream, [("install", INSTALL_SCRIPT.encode()), *files])


def install_packed(target: str, file: Path) -> str:
    """Install the server on a brick by running the script in a file made by `pack`."""
    wrong = (OSError, tarfile.TarError, ValueError)
    with (
        told_as(ConfigurationError, f"cannot read {file}", *wrong),
        tarfile.open(file, "r:") as tar,
    ):
        first = tar.next()
        member = tar.extractfile(first) if first and first.name == "install" else None
        script = member.read().decode() if member else ""
    if not script:
        raise ConfigurationError(f"{file} was not made by: drivelesson brick pack FILE")
    return run_on_brick(target, script, file)
