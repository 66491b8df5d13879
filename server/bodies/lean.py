"""Runs the command line on a brick, with less memory: `python -m server.bodies.lean`.

A brick has 64 MB of memory, of which OpenSSL would use 5 MB. Modules that load OpenSSL are
therefore replaced before anything imports them: https is unavailable, and `hashlib` uses Python's
own code. Some other modules are loaded only when they are used; numpy's random numbers, for
example, need 2 MB.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType
from typing import Any

LEFT_OUT = ("_bz2", "_ctypes", "_hashlib", "_lzma", "_ssl")
"""Modules whose import is made to fail, because they load libraries that a brick does not need:
OpenSSL, libffi and two compressors. Every module that imports one of them has a fallback."""

PUT_OFF = ("logging.config", "numpy.fft", "numpy.ma", "numpy.polynomial", "numpy.random")
"""Modules that numpy and uvicorn import, but that are not used while a brick drives."""


class StandIn(ModuleType):
    """Replaces the module `ssl`. Every attribute exists, so that code that imports `ssl` still
    loads.

    Libraries use expressions such as `int(ssl.PROTOCOL_TLS_SERVER)` and `except ssl.SSLError`.
    Attributes in capitals are therefore the number 0, and all other attributes are exception
    classes.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = 0 if name.isupper() else type(name, (OSError,), {})
        setattr(self, name, made)
        return made


class LazyImports:
    """Import hook that loads a module of `PUT_OFF` only at the first access to an attribute.

    The class does not inherit from `importlib.abc.MetaPathFinder`, whose import loads the
    compressors.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec for a module of `PUT_OFF`, which is then loaded at its first use. Return
        None for all other modules."""
        if fullname not in PUT_OFF:
            return None
        spec = PathFinder.find_spec(fullname, path)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def leave_out_unused() -> None:
    """Replace the modules of `LEFT_OUT`, and delay those of `PUT_OFF`, unless already imported."""
    for name in LEFT_OUT:
        sys.modules.setdefault(name, None)  # type: ignore[arg-type]
    sys.modules.setdefault("ssl", StandIn("ssl"))
    sys.meta_path.insert(0, LazyImports())


if __name__ == "__main__":
    leave_out_unused()
    from server.cli.main import main

    sys.exit(main())
