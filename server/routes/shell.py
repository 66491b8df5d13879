"""`/shell.json`: the page's files, so that the service worker caches them on the first visit."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Depends, Request

from server.security.guard import require_viewer
from server.services import services_of

router = APIRouter()
_KEPT = {".css", ".js", ".png", ".svg", ".webmanifest"}
_APART = ("sw.js", "js/pair.js", "css/pair.css", "js/eye", "css/eye.css", "js/study/", "board/")
"""Not fetched by every visitor: the service worker itself, the pairing page, the page of a phone
that is an eye, the study (cached once it was opened), and the teacher's board."""


def shell_files(folder: Path) -> list[str]:
    """List the addresses of the page's files."""
    paths = (path.relative_to(folder) for path in folder.rglob("*") if path.suffix in _KEPT)
    names = sorted(path.as_posix() for path in paths)
    return ["/", *(f"/{name}" for name in names if not name.startswith(_APART))]


@router.get("/shell.json", dependencies=[Depends(require_viewer)], include_in_schema=False)
def list_shell(request: Request) -> list[str]:
    """List what the page needs to open without the robot."""
    return shell_files(services_of(request).config.web_folder)
