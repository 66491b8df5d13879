"""FastAPI reads the parameters of each route once in a process, instead of once in each app.

Hundreds of tests make an app of the same routes, and this was most of their time.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import CodeType
from typing import Any

from fastapi.dependencies import utils


def read_routes_once() -> None:
    """Have FastAPI remember what it has read, if this version reads in these steps."""
    reader: Any = utils
    if not hasattr(reader, "get_typed_signature") or not hasattr(reader, "analyze_param"):
        return
    if not isinstance(reader.get_typed_signature, _Signatures):
        reader.get_typed_signature = _Signatures(reader.get_typed_signature)
        reader.analyze_param = _Parameters(reader.analyze_param, reader.get_typed_signature)


class _Signatures:
    """Returns the same signature for each copy of a function that has the same defaults."""

    def __init__(self, read: Callable[[Any], inspect.Signature]) -> None:
        self._read = read
        self._known: dict[CodeType, tuple[list[object], inspect.Signature]] = {}
        self.now: CodeType | None = None
        """The function whose known signature was returned last; its parameters are asked next."""

    def __call__(self, call: Any) -> inspect.Signature:
        self.now = None
        code = getattr(call, "__code__", None)
        if code is None:
            return self._read(call)
        defaults = [*(call.__defaults__ or ()), *(call.__kwdefaults__ or {}).values()]
        before, signature = self._known.get(code, ([], None))
        if signature is not None and [*map(id, before)] == [*map(id, defaults)]:
            self.now = code
            return signature
        signature = self._read(call)
        self._known[code] = defaults, signature
        return signature


class _Parameters:
    """Returns the same field for a parameter of a known signature, unless it is a dependency."""

    def __init__(self, analyze: Any, signatures: _Signatures) -> None:
        self._analyze, self._signatures = analyze, signatures
        self._known: dict[object, tuple[Any, ...]] = {}

    def __call__(self, *, annotation: Any, value: Any, **about: Any) -> Any:
        if self._signatures.now is None:
            return self._analyze(annotation=annotation, value=value, **about)
        key = (self._signatures.now, id(annotation), id(value), str(sorted(about.items())))
        if key not in self._known:
            found = self._analyze(annotation=annotation, value=value, **about)
            if found.depends is not None:
                return found
            # An object that ended would leave its number to another one.
            self._known[key] = found, annotation, value
        return self._known[key][0]
