"""The page's files: joined ones kept for ever, the others asked for again."""

from __future__ import annotations

import hashlib
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.hosting.joined_page import JoinedPage, join_page
from server.security.guard import content_policy

_FOR_EVER = "max-age=31536000, immutable"


class PageFiles(StaticFiles):
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
        if path == "shell.json":
            return JSONResponse(self._page.shell)
        kind = "text/css" if path.endswith(".css") else "text/javascript"
        if path == "js/pair.js":
            return Response(self._page.pair, media_type=kind)
        if path in self._page.files:
            kept = {"cache-control": _FOR_EVER}
            return Response(self._page.files[path], 200, kept, kind)
        return await super().get_response(path, scope)


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
    return Response(page.html, 200, headers, "text/html")
