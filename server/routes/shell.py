"""`/shell.json`: the page's files, so that the service worker keeps them after the first visit."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Request
from starlette.concurrency import run_in_threadpool

from server.hosting.joined_page import join_page
from server.routes.answers import Route
from server.security.guard import VIEWER
from server.services import services_of

router = APIRouter(route_class=Route)
_ICONS = {".png", ".svg", ".webmanifest"}
_APART = "-study.js"
"""Not fetched by every visitor: the study is kept once it was opened."""


def shell_files(folder: Path) -> list[str]:
    """List the page's files, by their addresses below its own."""
    icons = sorted(path for path in folder.rglob("*") if path.suffix in _ICONS)
    joined = [name for name in join_page(folder).files if not name.endswith(_APART)]
    return ["./", *joined, *(path.relative_to(folder).as_posix() for path in icons)]


@router.get("/shell.json", dependencies=[VIEWER], include_in_schema=False)
async def list_shell(request: Request) -> list[str]:
    """List what the page needs to open without the robot."""
    return await run_in_threadpool(shell_files, services_of(request).config.web_folder)
