"""Makes an environment in which pip installs a third-party package beside the project."""

from __future__ import annotations

import contextlib
import importlib
import os
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import Any

COMMANDS = {
    "drivelesson": "from server.__main__ import main; sys.exit(main())",
    "pytest": "import pytest; sys.exit(pytest.main())",
    "pip": "from pip._internal.cli.main import main; sys.exit(main())",
}
# A third party has none of our pytest plugins. The build tools are already installed here; pip only
# checks that they meet the package's requirements.
_QUIET = {
    "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    "PIP_NO_BUILD_ISOLATION": "0",  # for pip, 0 means no build isolation
    "PIP_CHECK_BUILD_DEPENDENCIES": "1",
    "PYTEST_ADDOPTS": "-p no:anyio",
}


@contextlib.contextmanager
def imported(folder: Path, *names: str) -> Iterator[list[Any]]:
    """Import modules from a package's folder inside the block, and forget them afterwards."""
    sys.path.insert(0, str(folder))
    try:
        yield [importlib.import_module(name) for name in names]
    finally:
        sys.path.remove(str(folder))
        for name in names:
            sys.modules.pop(name, None)


class OwnEnvironment:
    """A virtual environment that also sees the packages of this one, so that little is
    installed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        made = [sys.executable, "-m", "venv", "--without-pip", str(folder)]
        subprocess.run(made, check=True, timeout=100)
        self.python = folder / "bin" / "python"
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        site = folder / "lib" / version / "site-packages"
        parent = sysconfig.get_path("purelib")
        (site / "parent.pth").write_text(f"import site; site.addsitedir({parent!r})\n")
        for name, code in COMMANDS.items():
            script = folder / "bin" / name
            script.write_text(f"#!{self.python}\nimport sys\n{code}\n")
            script.chmod(0o755)

    def run(self, command: str, cwd: Path) -> str:
        """Run a shell line with this environment's commands; return its output."""
        path = f"{self.folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            command,
            shell=True,
            cwd=cwd,
            env={**os.environ, **_QUIET, "PATH": path},
            capture_output=True,
            text=True,
            timeout=280,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
        return done.stdout
