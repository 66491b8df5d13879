"""The page's modules become few files that mean the same and may be kept for ever."""

from __future__ import annotations

import asyncio
import base64
import gzip
import hashlib
import re
import shutil
from pathlib import Path

import httpx
import pytest
from starlette.exceptions import HTTPException

from server.hosting.joined_page import JoinError, join_page, shrink
from server.hosting.static_files import PageFiles
from tests.server.live_robot import WEB


@pytest.fixture
def web(tmp_path: Path) -> Path:
    """A copy of the page, to be changed."""
    return shutil.copytree(WEB, tmp_path / "web")


def change(web: Path, name: str, text: str) -> None:
    path = web / "js" / name
    path.write_text(path.read_text() + text)
    with (web / "js" / "more.js").open("a") as file:  # a clock of a second tells no change
        file.write("// changed\n")


def name_of(address: str) -> str:
    return address.split("-", 1)[1]


def test_each_module_is_in_one_file_and_each_file_is_named_by_its_content() -> None:
    page = join_page(WEB)
    modules = [m.split("'")[1] for text in page.files.values() for m in given(text.decode())]
    assert {"js/main.js", "js/stop.js", "js/components/home-screen.js"} < set(modules)
    shared = {"js/painter.js", "js/picture.js", "js/protocol.js"}  # drawn by a worker, or without
    assert {m for m in modules if modules.count(m) > 1} == shared
    for address, data in page.files.items():
        assert address.split("/")[1].startswith(hashlib.sha256(data).hexdigest()[:10] + "-")
    asked = set(re.findall(r"(?:js|css)/[0-9a-f]{10}-[\w-]+\.\w+", page.html.decode()))
    for text in page.files.values():
        beside = re.findall(r"(?:js|\.)(/[0-9a-f]{10}-[\w-]+\.js)", text.decode())
        asked |= {f"js{name}" for name in beside}
    assert asked == set(page.files), "what is asked for is there, and nothing else"


def given(text: str) -> list[str]:
    return re.findall(r"^\$m\['js/[^']+'\] = ", text, re.MULTILINE)


def test_only_what_changes_gets_another_name(web: Path) -> None:
    before = set(join_page(web).files)
    change(web, "components/home-screen.js", "const unused = 1;\n")
    changed = before ^ set(join_page(web).files)
    assert {name_of(address) for address in changed} == {"screens.js", "drive.js"}
    assert len(changed) == 4


def test_a_new_language_is_one_file_and_may_be_half_done(web: Path) -> None:
    messages = web / "js" / "messages"
    few = "export default {\n  emergency_stop: 'HALT',\n  'pair.title': 'Einlass',\n};\n"
    (messages / "de.js").write_text(few)
    page = join_page(web)
    assert '"de": {"emergency_stop": "HALT"}' in page.html.decode()
    assert '"de": {"title": "Einlass"}' in page.pair.decode()
    [address] = [address for address in page.files if name_of(address) == "de.js"]
    assert f'"de": "{address}"' in page.html.decode()


@pytest.mark.parametrize(
    "line", ["await later();\n", "export let changes = 1;\n", "import './misspelt.js';\n"]
)
def test_what_cannot_be_joined_is_refused_by_name(web: Path, line: str) -> None:
    path = web / "js" / "store.js"
    path.write_text(line + path.read_text())
    with pytest.raises(JoinError, match=r"store\.js|misspelt\.js"):
        join_page(web)


@pytest.mark.parametrize(
    ("source", "left"),
    [
        ("// gone\nconst a = 1; // gone\n", "const a = 1;\n"),
        ("/** gone\n * too */\nf(/** @type {any} */ (b));\n", "f((b));\n"),
        ("/** @type {any} */ (a).b();\n/* c */\n", "(a).b();\n"),
        ("const url = 'http://x/'; // it's kept\n", "const url = 'http://x/'; // it's kept\n"),
        ("const part = `//${a} /* no */`;\n", "const part = `//${a} /* no */`;\n"),
    ],
)
def test_comments_go_and_texts_stay(source: str, left: str) -> None:
    assert shrink(source) == left


_FILES = PageFiles(WEB)


def get(path: str, **headers: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(app=_FILES)
        async with httpx.AsyncClient(transport=transport, base_url="http://page") as client:
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            return await client.get(path, headers=named)

    return asyncio.run(ask())


def test_joined_files_are_kept_for_ever_and_the_document_is_asked_for_again() -> None:
    document = get("/")
    assert document.headers["cache-control"] == "no-cache"
    for address in join_page(WEB).files:
        file = get(address)
        assert "immutable" in file.headers["cache-control"]
        assert file.headers["content-encoding"] == "gzip"
        kind = "javascript" if address.endswith(".js") else "css"
        assert kind in file.headers["content-type"]
        # On Windows starlette asks for it so.
        assert get(address.replace("/", "\\")).content == file.content
    plain = get("/", accept_encoding="identity")
    assert "content-encoding" not in plain.headers
    assert plain.content == document.content
    with pytest.raises(HTTPException) as refused:
        get("/js/0123456789-drive.js")
    assert refused.value.status_code == 404


def test_scripts_in_the_document_are_allowed_by_hash_even_if_it_has_not_changed() -> None:
    document = get("/")
    again = get("/", if_none_match=document.headers["etag"])
    assert again.status_code == 304
    for answer in (document, again):
        policy = answer.headers["content-security-policy"]
        assert "unsafe" not in policy
        for tag in ("script", "style"):
            [text] = re.findall(rf"<{tag}>(.*?)</{tag}>", document.text, re.DOTALL)
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            assert f"'sha256-{digest}'" in policy


def test_the_first_visit_is_small() -> None:
    page = join_page(WEB)
    first = [data for address, data in page.files.items() if name_of(address) in FIRST]
    sizes = [len(gzip.compress(data, 9)) for data in (page.html, *first)]
    assert len(sizes) == 1 + len(FIRST)
    assert sum(sizes) < 60_000


FIRST = {"page.css", "drive.js", "en.js", "video-worker.js"}
