"""Serves the page's files compressed; files with a hash in their name are cached indefinitely."""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
import re
from base64 import b64encode
from functools import lru_cache
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.gateway.guard import content_policy

_TEXT = ("text/", "application/json", "application/manifest+json", "image/svg+xml")
_IMMUTABLE = "max-age=31536000, immutable"
_HASHED = re.compile(r"(?:css|js)/[0-9a-f]{10}-")


class CompressedFiles(StaticFiles):
    """Serves a folder like `StaticFiles`, but compresses text."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder)
        for suffix in (".js", ".mjs"):  # Windows' registry may declare them as plain text
            mimetypes.add_type("text/javascript", suffix)
        mimetypes.add_type("application/manifest+json", ".webmanifest")

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        return _compress(response, scope) if isinstance(response, FileResponse) else response


class PageFiles(CompressedFiles):
    """Serves the page: bundled in a wheel (`web/bundle.py`), or the sources in a clone."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        path = path.replace("\\", "/")  # starlette passes paths with the system's separator
        path = "index.html" if path == "." else path
        response = await super().get_response(path, scope)
        if path == "index.html":
            # Without a referrer, a form sends no origin, and the server would refuse its STOP.
            response.headers["referrer-policy"] = "same-origin"
            # A 304 needs this header, too: its headers replace those in the browser's cache.
            html = (Path(self.directory or "") / "index.html").read_text("utf-8")
            response.headers["content-security-policy"] = content_policy(
                scope["scheme"], Headers(scope=scope).get("host", ""), _hashes(html)
            )
        if _HASHED.match(path):
            response.headers["cache-control"] = _IMMUTABLE
        return response


@lru_cache(maxsize=4)
def _hashes(html: str) -> list[str]:
    """Return the hashes of the inline script and style in a document."""
    parts = re.findall(r"<(?:script|style)>(.*?)</(?:script|style)>", html, re.DOTALL)
    hashes = [hashlib.sha256(part.encode()).digest() for part in parts]
    return [f"'sha256-{b64encode(each).decode()}'" for each in hashes]


def _compress(response: FileResponse, scope: Scope) -> Response:
    """Compress a text response if the client accepts that; return other responses unchanged."""
    headers = response.headers
    if not headers.get("content-type", "").startswith(_TEXT):
        return response
    headers["vary"] = "accept-encoding"
    if "gzip" not in Headers(scope=scope).get("accept-encoding", ""):
        return response
    about_data = ("content-length", "accept-ranges")
    kept = {name: value for name, value in headers.items() if name not in about_data}
    return Response(
        _pack(Path(response.path).read_bytes()),
        response.status_code,
        {**kept, "content-encoding": "gzip"},
    )


@lru_cache(maxsize=160)
def _pack(data: bytes) -> bytes:
    return gzip.compress(data, 9, mtime=0)
