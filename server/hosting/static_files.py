"""The page's files, compressed with gzip where the browser accepts it, once a version."""

from __future__ import annotations

import gzip
from functools import lru_cache
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_TEXT = ("text/", "application/json", "application/manifest+json", "image/svg+xml")


class CompressedFiles(StaticFiles):
    """Serves a folder as `StaticFiles` does, with text compressed."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer with the file, compressed if it is text."""
        response = await super().get_response(path, scope)
        takes_gzip = "gzip" in Headers(scope=scope).get("accept-encoding", "")
        kind = response.headers.get("content-type", "")
        is_text = kind.startswith(_TEXT)
        if not (takes_gzip and is_text and isinstance(response, FileResponse)):
            return response
        etag = response.headers.get("etag", "")
        headers = {
            "etag": etag,
            "last-modified": response.headers.get("last-modified", ""),
            "content-encoding": "gzip",
            "content-type": kind,
            "vary": "accept-encoding",
        }
        return Response(_pack(str(response.path), etag), response.status_code, headers)


@lru_cache(maxsize=128)
def _pack(path: str, version: str) -> bytes:
    """Return the file's bytes, compressed; `version` changes with the file."""
    return gzip.compress(Path(path).read_bytes(), 9, mtime=0)
