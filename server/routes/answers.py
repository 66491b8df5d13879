"""Answers and errors of routes, as dataclasses that FastAPI describes in `/openapi.json`."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable
from dataclasses import fields
from functools import partial
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter, FastAPI, Response
from fastapi.routing import APIRoute
from numpy.typing import NDArray

from robot import __version__
from robot.devices.encoders import encode_png

_T = TypeVar("_T")
_WHY = {
    400: "the body or the path is malformed",
    401: "this browser is not admitted",
    403: "this browser is not allowed to do this",
    404: "not found",
    409: "not possible now, or not with this value",
    413: "the body is too large",
    421: "the request is addressed to another name",
    422: "a value is not valid",
    423: "locked",
    429: "too many requests",
    501: "a library is missing",
    503: "not available now",
    507: "the data folder cannot be used",
}


def media(*kinds: str) -> dict[str, Any]:
    """Return the options of a route whose answer is not JSON but has one of these media types."""
    content: dict[str, Any] = {kind: {} for kind in kinds}
    return {"responses": {200: {"content": content}}, "response_class": Response}


PNG = media("image/png")


def png(pixels: NDArray[np.uint8], keep_s: int = 0) -> Response:
    """Answer with a picture that the browser may cache for `keep_s` seconds."""
    headers = {"cache-control": f"private, max-age={keep_s}"} if keep_s else None
    return Response(encode_png(pixels), media_type="image/png", headers=headers)


def png_text(pixels: NDArray[np.uint8]) -> str:
    """Return a picture as a field of JSON: PNG in base64."""
    return b64encode(encode_png(pixels)).decode()


def attachment(data: bytes, kind: str, name: str) -> Response:
    """Answer with a file that the browser saves under a name."""
    headers = {"content-disposition": f"attachment; filename*=UTF-8''{quote(name, safe='')}"}
    return Response(data, media_type=kind, headers=headers)


def answer(kind: type[_T], source: Any, **own: Any) -> _T:
    """Make an answer from the fields in `own`; the other fields are the attributes of `source`."""
    names = (field.name for field in fields(kind) if field.name not in own)  # type: ignore[arg-type]
    return kind(**{name: getattr(source, name) for name in names}, **own)


class Route(APIRoute):
    """A route without a response model, so that the server starts sooner on a slow computer.

    `described` creates the same route with a response model, for `/openapi.json`.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        self.described = partial(APIRoute, path, endpoint, **options)
        super().__init__(path, endpoint, **{**options, "response_model": None})


def describe_routes(app: FastAPI, routers: Iterable[APIRouter]) -> dict[str, Any]:
    """Return the content of `/openapi.json`: each route's parameters, answer and errors."""
    content = {"application/json": {"schema": {"$ref": "#/components/schemas/Refusal"}}}
    errors: Any = {code: {"description": why, "content": content} for code, why in _WHY.items()}
    twin = FastAPI(title=app.title, version=__version__)
    for route in (route for router in routers for route in router.routes):
        if isinstance(route, Route):
            route = route.described(responses={**route.responses, **errors})
        twin.router.routes.append(route)
    found = twin.openapi()
    detail = {"detail": {"type": "string"}, "error": {"type": "string"}}
    refusal = {"type": "object", "properties": detail, "required": ["detail"]}
    found["components"]["schemas"]["Refusal"] = refusal
    return found
