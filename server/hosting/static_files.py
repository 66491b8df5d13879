"""The page's files: joined ones kept for ever, the others asked for again; text is compressed."""

from __future__ import annotations

import gzip
import hashlib
from functools import lru_cache
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.hosting.joined_page import JoinedPage, join_page
from server.security.guard import content_policy

_TEXT = ("text/", "application/json", "application/manifest+json", "image/svg+xml")
_FOR_EVER = "max-age=31536000, immutable"
_KINDS = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}


class CompressedFiles(StaticFiles):
    """Serves a folder as `StaticFiles` does, with text compressed."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer with the file, compressed if it is text."""
        response = await super().get_response(path, scope)
        kind = response.headers.get("content-type", "")
        is_text = kind.startswith(_TEXT)
        if not (_takes_gzip(scope) and is_text and isinstance(response, FileResponse)):
            return response
        etag = response.headers.get("etag", "")
        headers = {
            "etag": etag,
            "last-modified": response.headers.get("last-modified", ""),
            "content-encoding": "gzip",
            "content-type": kind,
            "vary": "accept-encoding",
        }
        return Response(_pack_file(str(response.path), etag), response.status_code, headers)


class PageFiles(CompressedFiles):
    """Serves the page joined, and everything else in its folder as it is."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder)
        self._folder = folder
        self._page: JoinedPage | None = None

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer with the document, a joined file, or another file of the folder."""
        path = path.replace("\\", "/")  # starlette gives a path of the system's own
        is_document = path in (".", "index.html")
        if is_document or self._page is None:
            self._page = await run_in_threadpool(join_page, self._folder)
        if is_document:
            return _document(self._page, scope)
        if path == "js/pair.js":
            fresh = {"content-type": _KINDS[".js"], "cache-control": "no-cache"}
            return _answer(self._page.pair, scope, fresh)
        joined = self._page.files.get(path)
        if joined is None:
            return await super().get_response(path, scope)
        kind = _KINDS[Path(path).suffix]
        return _answer(joined, scope, {"content-type": kind, "cache-control": _FOR_EVER})


def _document(page: JoinedPage, scope: Scope) -> Response:
    sent = Headers(scope=scope)
    etag = f'"{hashlib.sha256(page.html).hexdigest()[:16]}"'
    headers = {
        "etag": etag,
        "cache-control": "no-cache",
        # Without a referrer a form has no origin, and its STOP would be taken for a stranger's.
        "referrer-policy": "same-origin",
        # Also of an answer without a body: a browser puts its headers over those that it has kept.
        "content-security-policy": content_policy(
            scope["scheme"], sent.get("host", ""), page.inline
        ),
    }
    if sent.get("if-none-match") == etag:
        return Response(status_code=304, headers=headers)
    return _answer(page.html, scope, {"content-type": "text/html; charset=utf-8", **headers})


def _answer(data: bytes, scope: Scope, headers: dict[str, str]) -> Response:
    headers["vary"] = "accept-encoding"
    if _takes_gzip(scope):
        headers["content-encoding"] = "gzip"
        data = _pack(data)
    return Response(data, headers=headers)


def _takes_gzip(scope: Scope) -> bool:
    return "gzip" in Headers(scope=scope).get("accept-encoding", "")


@lru_cache(maxsize=128)
def _pack_file(path: str, version: str) -> bytes:
    """Return the file's bytes, compressed; `version` changes with the file."""
    return gzip.compress(Path(path).read_bytes(), 9, mtime=0)


@lru_cache(maxsize=32)
def _pack(data: bytes) -> bytes:
    return gzip.compress(data, 9, mtime=0)
