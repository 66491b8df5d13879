"""Leaving out what a server on a brick never uses, though the libraries below it import it.

With `DRIVELESSON_LEAN=1`, as the brick's start-up unit sets it, these modules are replaced before
anything imports them: 64 MB is all there is, and OpenSSL alone takes five. https is then not to
be had; `hashlib` does the same sums with Python's own code.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any

LEFT_OUT = ("_hashlib", "_ssl")
"""OpenSSL by its two doors. Whoever asks gets an ImportError, and each caller has another way."""


class StandIn(ModuleType):
    """A module that has every name, so that `import` and annotations work, and does nothing.

    A name in capitals is the number 0, any other an exception of its own: some libraries say
    `int(ssl.PROTOCOL_TLS_SERVER)` or `except ssl.SSLError`.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = 0 if name.isupper() else type(name, (OSError,), {})
        setattr(self, name, made)
        return made


def leave_out_unused(environ: Mapping[str, str] = os.environ) -> None:
    """Put the stand-ins in place if the environment asks for it; what is loaded already stays."""
    if environ.get("DRIVELESSON_LEAN") != "1":
        return
    for name in LEFT_OUT:
        sys.modules.setdefault(name, None)  # type: ignore[arg-type]
    sys.modules.setdefault("ssl", StandIn("ssl"))
