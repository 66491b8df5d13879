"""The command line without modules that a brick never needs: `python -m server.bodies.lean`.

A brick has 64 MB of memory, and OpenSSL would use five. OpenSSL's modules are replaced before
anything imports them. So https is unavailable, and `hashlib` uses Python's own code. Other modules
are loaded only when they are used; numpy's random numbers, for example, need two MB.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType
from typing import Any

LEFT_OUT = ("_bz2", "_ctypes", "_hashlib", "_lzma", "_ssl")
"""Modules that load libraries which a brick never uses: OpenSSL, libffi and two compressors. The
import of these modules fails, and each importer has a fallback."""

PUT_OFF = ("logging.config", "numpy.fft", "numpy.ma", "numpy.polynomial", "numpy.random")
"""Modules that numpy and uvicorn import, and that a lesson on a brick never touches."""


class StandIn(ModuleType):
    """A module that contains every name and does nothing, so that imports and annotations work.

    A name in capitals is the number 0, and any other name is an exception class, because some
    libraries use `int(ssl.PROTOCOL_TLS_SERVER)` or `except ssl.SSLError`.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = 0 if name.isupper() else type(name, (OSError,), {})
        setattr(self, name, made)
        return made


class PutOff:
    """Import hook for the modules of `PUT_OFF`; the first attribute access loads the module.

    This class has no base class, because `importlib.abc` imports the compressors.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec that loads the module later; None for other modules."""
        if fullname not in PUT_OFF:
            return None
        spec = PathFinder.find_spec(fullname, path)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def leave_out_unused() -> None:
    """Leave out and put off the modules above; modules already loaded stay."""
    for name in LEFT_OUT:
        sys.modules.setdefault(name, None)  # type: ignore[arg-type]
    sys.modules.setdefault("ssl", StandIn("ssl"))
    sys.meta_path.insert(0, PutOff())


if __name__ == "__main__":
    leave_out_unused()
    from server.cli.main import main

    sys.exit(main())
