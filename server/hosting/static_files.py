"""Serves the page's files compressed; joined files are cached, others revalidated."""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
from functools import lru_cache
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.gateway.guard import content_policy
from server.hosting.joined_page import JoinedPage, join_page

_TEXT = ("text/", "application/json", "application/manifest+json", "image/svg+xml")
_FOR_EVER = "max-age=31536000, immutable"


class CompressedFiles(StaticFiles):
    """Serves a folder as `StaticFiles` does, with text compressed."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder)
        for suffix in (".js", ".mjs"):  # Windows' registry may say that they are plain text
            mimetypes.add_type("text/javascript", suffix)
        mimetypes.add_type("application/manifest+json", ".webmanifest")

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        return _compress(response, scope) if isinstance(response, FileResponse) else response


class PageFiles(CompressedFiles):
    """Serves the joined page, and the other files of its folder unchanged."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._folder = folder
        self._page: JoinedPage | None = None

    async def get_response(self, path: str, scope: Scope) -> Response:
        path = path.replace("\\", "/")  # starlette gives a path of the system's own
        is_document = path in (".", "index.html")
        if is_document or self._page is None:
            self._page = await run_in_threadpool(join_page, self._folder)
        if is_document:
            return _document(self._page, scope)
        if path == "shell.json":
            return JSONResponse(self._page.shell)
        kind = "text/css" if path.endswith(".css") else "text/javascript"
        if path == "js/pair.js":
            return _compress(Response(self._page.pair, media_type=kind), scope)
        if path in self._page.files:
            kept = {"cache-control": _FOR_EVER}
            return _compress(Response(self._page.files[path], 200, kept, kind), scope)
        return await super().get_response(path, scope)


def _document(page: JoinedPage, scope: Scope) -> Response:
    sent = Headers(scope=scope)
    etag = f'"{hashlib.sha256(page.html).hexdigest()[:16]}"'
    headers = {
        "etag": etag,
        "cache-control": "no-cache",
        # Without a referrer a form has no origin, and its STOP would be refused as foreign.
        "referrer-policy": "same-origin",
        # Also for an answer without a body: its headers replace those in the browser's cache.
        "content-security-policy": content_policy(
            scope["scheme"], sent.get("host", ""), page.inline
        ),
    }
    if sent.get("if-none-match") == etag:
        return Response(status_code=304, headers=headers)
    return _compress(Response(page.html, 200, headers, "text/html"), scope)


def _compress(response: Response, scope: Scope) -> Response:
    """Return a text compressed if the client accepts that."""
    headers = response.headers
    if not headers.get("content-type", "").startswith(_TEXT):
        return response
    headers["vary"] = "accept-encoding"
    if "gzip" not in Headers(scope=scope).get("accept-encoding", ""):
        return response
    if isinstance(response, FileResponse):
        data = Path(response.path).read_bytes()
    else:
        data = bytes(response.body)
    about_data = ("content-length", "accept-ranges")
    kept = {name: value for name, value in headers.items() if name not in about_data}
    return Response(_pack(data), response.status_code, {**kept, "content-encoding": "gzip"})


@lru_cache(maxsize=160)
def _pack(data: bytes) -> bytes:
    return gzip.compress(data, 9, mtime=0)
