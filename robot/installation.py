"""How this program was installed, so that advice names a command that works here."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import shlex
import sys
from pathlib import Path


def install_command(extra: str) -> str:
    """Return the command that adds the libraries of one extra to this installation."""
    wanted = f"drivelesson[{extra}]"
    clone = _clone()
    if clone is not None:
        return f"{_pip_install()} --editable {shlex.quote(f'{clone}[{extra}]')}"
    source = _source()
    if source:
        wanted = f"{wanted} @ {source}"
    quoted = f"'{wanted}'"
    places = Path(sys.prefix).parts
    if "uv" in places and "tools" in places:
        return f"uv tool install --force {quoted}"
    if "uv" in places:  # uvx keeps its environments in uv's cache
        return f"uvx --from {quoted} drivelesson"
    if "pipx" in places:
        return f"pipx install --force {quoted}"
    return f"{_pip_install()} {quoted}"


def version() -> str:
    """Return the installed version; `unknown` where there is no metadata."""
    try:
        return importlib.metadata.version("drivelesson")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _clone() -> Path | None:
    """Return the folder of the source code that this program runs from, if it does."""
    folder = Path(__file__).resolve().parents[1]
    return folder if (folder / "pyproject.toml").is_file() else None


def _source() -> str | None:
    """Return the file or folder that was installed; None for the package index (PEP 610)."""
    try:
        text = importlib.metadata.distribution("drivelesson").read_text("direct_url.json")
        return str(json.loads(text)["url"]) if text else None
    except (importlib.metadata.PackageNotFoundError, ValueError, KeyError, TypeError):
        return None


def _pip_install() -> str:
    """Return pip for the very Python that runs, whatever is on the PATH."""
    if importlib.util.find_spec("pip") is None:
        return f"uv pip install --python {shlex.quote(sys.executable)}"
    return f"{shlex.quote(sys.executable)} -m pip install"
