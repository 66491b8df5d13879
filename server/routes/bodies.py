"""Helpers for routes: read a JSON body, and turn errors into HTTP answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fastapi import HTTPException, Request
from starlette.concurrency import run_in_threadpool

from robot.errors import ConfigurationError, MissingExtraError, NotFoundError, RobotError
from server.services import services_of


@contextmanager
def refusals() -> Iterator[None]:
    """Turn an error into an HTTP status and a sentence for the page."""
    try:
        yield
    except NotFoundError as error:
        raise HTTPException(404, str(error)) from error
    except ConfigurationError as error:
        raise HTTPException(409, str(error)) from error
    except MissingExtraError as error:
        raise HTTPException(501, str(error)) from error
    except RobotError as error:
        raise HTTPException(422, str(error)) from error
    except OSError as error:
        raise HTTPException(
            507, f"The data folder cannot be used: {error.strerror or error}"
        ) from error


async def do(action: Callable[..., Any], *args: Any) -> Any:
    """Run an action that uses the disk in a thread, with errors as HTTP answers."""
    with refusals():
        return await run_in_threadpool(action, *args)


def require_no_session(request: Request) -> None:
    """Dependency of what changes the model in use: 409 while a participant's session is on."""
    with refusals():
        for extension in services_of(request).extensions.values():
            extension.require_free_model()


async def read_body(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request carries; {} if it has no body.

    Raises:
        HTTPException: 400 if it is anything else.
    """
    raw = await request.body()
    try:
        body = await request.json() if raw else {}
    except (ValueError, RecursionError) as error:
        raise HTTPException(400, "The body is not JSON.") from error
    if not isinstance(body, dict):
        raise HTTPException(400, "The body must be a JSON object.")
    return body


def text_field(body: dict[str, Any], name: str, default: str | None = None) -> str | None:
    """Return a text field of the body, or the default; 400 if it is not text, or too long."""
    value = body.get(name, default)
    if value is not None and (not isinstance(value, str) or len(value) > 200):
        raise HTTPException(400, f"{name!r} must be a text of at most 200 characters.")
    try:
        (value or "").encode()
    except UnicodeEncodeError as error:  # half a surrogate pair cannot be encoded
        raise HTTPException(400, f"{name!r} must be valid Unicode text.") from error
    return value
