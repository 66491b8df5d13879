"""Joins the page's files as in a wheel, once per run of tests."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from web.bundle import bundle

WEB = Path(__file__).resolve().parents[1] / "web"


@cache
def joined_page() -> Path:
    """Return the folder of the joined page."""
    folder = Path(tempfile.mkdtemp(prefix="drivelesson-page-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    bundle(WEB, folder / "web")
    return folder / "web"
