"""A brick's Debian under emulation: `qemu-arm -cpu arm926` in a chroot, with counters.

The root file system stays in var/armel-RELEASE, so only the first run builds it. It needs
root, qemu-user, mmdebstrap and a C compiler; if one is missing, its tests are skipped.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

import server
from robot.bodies.ev3.archive import make_bundle
from robot.bodies.ev3.rootfs import DEFAULT_RELEASE, build_userland, precompile, userland_stamp
from robot.bodies.ev3.scripts import ENVIRONMENT
from server.config import Config
from tests.kit.run import run

ROOT = Path(__file__).parents[4]
GUEST_BASE = 1 << 40
"""Address of the guest's 4 GB in the emulator's memory, which identifies the guest's pages."""


class Armel:
    """The userland with the program in /opt/drivelesson, and the emulator in /emulator."""

    def __init__(self) -> None:
        if not os.environ.get("DRIVELESSON_BRICK"):
            pytest.skip("only `make test-brick` starts the emulated brick")
        for tool in ("mmdebstrap", "qemu-arm", "cc", "unshare"):
            if shutil.which(tool) is None:
                _skip(f"{tool} is not installed")
        if os.geteuid() != 0:
            _skip("only root may change its root")
        self.release = os.environ.get("DRIVELESSON_RELEASE", DEFAULT_RELEASE)
        kept = ROOT / "var" / f"armel-{self.release}"
        self.root = kept / "root"
        stamp, wanted = kept / "packages", userland_stamp(self.release)
        if not stamp.is_file() or stamp.read_text() != wanted:
            shutil.rmtree(kept, ignore_errors=True)
            kept.mkdir(parents=True)
            build_userland(self.root, self.release, os.environ.get("DRIVELESSON_MIRROR", ""))
            self._precompile("usr/lib/python3.*", "usr/lib/python3/dist-packages")
            stamp.write_text(wanted)
        for folder in ("proc", "dev", "tmp"):
            (self.root / folder).mkdir(exist_ok=True)
        self._install_emulator()
        make_bundle(self.root / "opt/drivelesson", Path(server.__path__[0]), Config().web)
        self._precompile("opt/drivelesson")
        self.counters = self.root / "emulator/counters"
        self.counters.write_bytes(bytes(4096))

    def _install_emulator(self) -> None:
        folder = self.root / "emulator"
        folder.mkdir(exist_ok=True)
        qemu = shutil.which("qemu-arm")
        assert qemu is not None
        shutil.copy(qemu, folder / "qemu-arm")
        needed = subprocess.run(["ldd", qemu], capture_output=True, text=True, check=True).stdout
        for library in re.findall(r"(/\S+)", needed):
            shutil.copy(library, folder)
        self._loader = next(path.name for path in folder.glob("ld-linux*"))
        source = Path(__file__).with_name("count_instructions.c")
        library = ("-shared", "-fPIC", "-Wall", "-Werror", "-o", folder / "count_instructions.so")
        subprocess.run(["cc", "-O2", *library, source], check=True)

    def _precompile(self, *folders: str) -> None:
        if not precompile(self.root, folders, self.release):
            _skip("this Python cannot compile for the brick's; install its version")

    def command(self, *args: str, counting: bool = True) -> list[str]:
        """The command that runs the brick's Python with these arguments."""
        plugin = ["-plugin", "/emulator/count_instructions.so,into=/emulator/counters"]
        emulator = [f"/emulator/{self._loader}", "--library-path", "/emulator"]
        emulator += [
            "/emulator/qemu-arm",
            "-cpu",
            "arm926",
            "-r",
            "4.14.117",
            "-B",
            hex(GUEST_BASE),
        ]
        emulator += [*(plugin if counting else []), "/usr/bin/python3", "-OO", *args]
        # A separate mount namespace, in which nothing can stay mounted.
        script = (
            'mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && '
            'exec /usr/sbin/chroot "$0" "$@"'
        )
        return ["unshare", "--mount", "sh", "-c", script, str(self.root), *emulator]

    def run(self, *args: str) -> subprocess.CompletedProcess[str]:
        return run(*self.command(*args), env=ENVIRONMENT, timeout=300)

    def instructions(self) -> int:
        """Number of guest instructions so far, of all threads."""
        return sum(struct.unpack("512Q", self.counters.read_bytes()))


def guest_memory_mb(pid: int) -> dict[str, float]:
    """Resident memory of an emulator's guest, in MB: total, and private."""
    resident = private = 0
    is_guest = False
    for line in Path(f"/proc/{pid}/smaps").read_text().splitlines():
        if match := re.match(r"([0-9a-f]+)-[0-9a-f]+ ", line):
            is_guest = GUEST_BASE <= int(match[1], 16) < GUEST_BASE + (1 << 32)
        elif is_guest and line.startswith("Rss:"):
            resident += int(line.split()[1])
        elif is_guest and line.startswith("Private_"):
            private += int(line.split()[1])
    return {"resident": resident / 1024, "private": private / 1024}


def _skip(why: str) -> None:
    if os.environ.get("DRIVELESSON_BRICK"):
        raise RuntimeError(f"the brick's tests are required here, but {why}")
    pytest.skip(f"there is no emulated brick: {why}")
