"""Helpers for routes: types of request bodies, and functions that turn errors into answers."""

from __future__ import annotations

import inspect
from typing import Annotated, Any, get_type_hints

from fastapi import Depends, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from robot.devices.raw_value import RawValue, explain, kind_of, text
from robot.errors import ConfigurationError, MissingExtraError, NotFoundError, RobotError, reason
from server.services import services_of

do = run_in_threadpool
"""Runs a function on another thread, so that waiting for the disk does not block the event loop."""
Short = Annotated[str, Field(max_length=200)]


class Named(RawValue):
    """A request's body with an optional name."""

    name: str | None = text(None)


class Key(RawValue):
    """A request's body: `undo` is the key that a deletion returned."""

    undo: str = text()


NAMED = Named()


async def refuse_values(request: Request, error: Exception) -> JSONResponse:
    """Say which value is refused and what is allowed; status 400 for a body, 422 for a URL."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    place, *loc = first["loc"]
    endpoint = request.scope["endpoint"]
    hints = get_type_hints(endpoint)
    if place != "body":
        declared = inspect.signature(endpoint).parameters[loc[0]].default
        wanted = getattr(declared, "description", None) or kind_of(hints[loc[0]])
        return JSONResponse({"detail": f"{loc[0]!r} must be {wanted}."}, 422)
    is_json = "json" not in first["type"]
    sentence = explain(hints["body"], loc) if is_json else "The body is not JSON."
    if not loc and "json" not in request.headers.get("content-type", ""):
        sentence = "The body must be JSON, and be sent with Content-Type: application/json."
    return JSONResponse({"detail": sentence}, 400)


_STATUS = {NotFoundError: 404, ConfigurationError: 409, MissingExtraError: 501, OSError: 503}


async def refuse(request: Request, error: Exception) -> JSONResponse:
    """Turn an error into an HTTP status and a sentence for the page."""
    if request.scope["type"] != "http":
        raise error
    if not isinstance(error, RobotError):
        sentence = f"The data folder cannot be used: {reason(error)}"
        return JSONResponse({"detail": sentence}, 507)
    status = next((status for kind, status in _STATUS.items() if isinstance(error, kind)), 422)
    return JSONResponse({"detail": str(error)}, status)


HANDLERS: dict[Any, Any] = {
    RequestValidationError: refuse_values,
    **dict.fromkeys((RobotError, OSError), refuse),
}
"""The error handlers of the robot's and the board's applications."""


def require_free_model(request: Request) -> None:
    """Raise ConfigurationError while an extension forbids changes of the model in use."""
    for extension in services_of(request).extensions.values():
        extension.require_free_model()


FREE_MODEL = Depends(require_free_model)
