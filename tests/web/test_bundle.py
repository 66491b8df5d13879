"""A wheel has the page's modules as few files with the same code, which may be cached forever."""

from __future__ import annotations

import asyncio
import base64
import gzip
import hashlib
import json
import re
import shutil
from pathlib import Path

import httpx
import pytest
from starlette.exceptions import HTTPException

from server.hosting.static_files import PageFiles
from tests.joined_page import WEB, joined_page
from web.bundle import JoinError, bundle, shrink

HASHED = re.compile(r"(?:js|css)/[0-9a-f]{10}-[\w-]+\.\w+")


@pytest.fixture
def web(tmp_path: Path) -> Path:
    """A copy of the page, which a test may change."""
    return shutil.copytree(WEB, tmp_path / "web", ignore=shutil.ignore_patterns("__pycache__"))


def joined(web: Path) -> Path:
    shutil.rmtree(web.parent / "joined", ignore_errors=True)
    bundle(web, web.parent / "joined")
    return web.parent / "joined"


def files(page: Path) -> dict[str, bytes]:
    names = (path.relative_to(page).as_posix() for path in page.rglob("*"))
    return {name: (page / name).read_bytes() for name in names if HASHED.fullmatch(name)}


def name_of(address: str) -> str:
    return address.split("-", 1)[1]


def test_each_module_is_in_one_file_and_each_file_is_named_by_its_content() -> None:
    page = files(joined_page())
    given = re.compile(r"^\$m\['(js/[^']+)'\] = ", re.MULTILINE)
    modules = [name for text in page.values() for name in given.findall(text.decode())]
    assert {"js/main.js", "js/stop.js", "js/library/home-screen.js"} < set(modules)
    shared = {"js/painter.js", "js/picture.js", "js/protocol.js"}  # a worker needs them, too
    assert {m for m in modules if modules.count(m) > 1} == shared
    for address, data in page.items():
        assert address.split("/")[1].startswith(hashlib.sha256(data).hexdigest()[:10] + "-")
    assert asked_for(joined_page()) == set(page), "the page requests exactly the files that exist"
    cached = json.loads((joined_page() / "shell.json").read_text("utf-8"))
    assert not [file for file in cached if "eye" in file], "most visitors do not need the eye"
    assert set(page) < set(cached)
    told = "".join(data.decode() for name, data in page.items() if name.endswith(".js"))
    fetched = set(re.findall(r"\$load\('([^']+)'\)", told))
    [table] = re.findall(r"\$files = (\{.*?\})[,;]", told)
    assert "js/inputs/tilt.js" in fetched and fetched <= json.loads(table).keys()


def asked_for(page: Path) -> set[str]:
    """Return the addresses of files that the document and the files name."""
    asked = set(HASHED.findall((page / "index.html").read_text("utf-8")))
    for text in files(page).values():
        beside = re.findall(r"(?:js|\.)(/[0-9a-f]{10}-[\w-]+\.js)", text.decode())
        asked |= {f"js{name}" for name in beside}
    return asked


def test_only_what_changes_gets_another_name(web: Path) -> None:
    before = set(files(joined(web)))
    path = web / "js/coaching/gallery-screen.js"
    path.write_text(path.read_text() + "const unused = 1;\n")
    changed = before ^ set(files(joined(web)))
    assert {name_of(address) for address in changed} == {"coaching.js", "drive.js"}
    assert len(changed) == 4


def test_a_language_is_one_file_with_the_sentences_of_the_extensions(web: Path) -> None:
    few = "export default {\n  emergency_stop: 'HALT',\n};\n"
    (web / "js/messages/de.js").write_text(few)
    (web / "js/coaching/screens/messages/de.js").write_text(
        "export default {\n  'gallery.order': 'Folge',\n};\n"
    )
    page = joined(web)
    languages = {name_of(name): data.decode() for name, data in files(page).items()}
    german, later = languages["de.js"], languages["later-de.js"]
    assert "emergency_stop: 'HALT',\n" in german and german.count("emergency_stop") == 1
    assert "back: 'Back to driving',\n" in german, "English fills the gaps of a translation"
    assert "'gallery.order': 'Folge'" in later and "'gallery.newest': 'Newest first'" in later
    assert asked_for(page) == set(files(page))
    assert "'screen.study'" in languages["es.js"] and "'screen.home'" in languages["es.js"]


@pytest.mark.parametrize(
    "line",
    [
        "await later();\n",
        "export let changes = 1;\n",
        "import './misspelt.js';\n",
        "export const later = () => import('../js/misspelt.js');\n",
    ],
)
def test_what_cannot_be_joined_is_refused_by_name(web: Path, line: str) -> None:
    path = web / "js" / "store.js"
    path.write_text(line + path.read_text())
    with pytest.raises(JoinError, match=r"store\.js|misspelt\.js"):
        joined(web)


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
def test_bundling_removes_comments_and_keeps_texts(source: str, left: str) -> None:
    assert shrink(source) == left


def get(path: str, folder: Path | None = None, **headers: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(app=PageFiles(folder or joined_page()))
        async with httpx.AsyncClient(transport=transport, base_url="http://page") as client:
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            return await client.get(path, headers=named)

    return asyncio.run(ask())


def test_bundled_files_are_cached_forever_and_the_document_is_requested_again() -> None:
    document = get("/")
    for address in files(joined_page()):
        file = get(address)
        assert "immutable" in file.headers["cache-control"]
        assert file.headers["content-encoding"] == "gzip"
        kind = "javascript" if address.endswith(".js") else "css"
        assert kind in file.headers["content-type"]
        # On Windows, starlette asks for a file with backslashes.
        assert get(address.replace("/", "\\")).content == file.content
    plain = get("/", accept_encoding="identity")
    assert "content-encoding" not in plain.headers
    assert plain.content == document.content
    with pytest.raises(HTTPException) as refused:
        get("/js/0123456789-drive.js")
    assert refused.value.status_code == 404


@pytest.mark.parametrize("folder", [WEB, None], ids=["clone", "wheel"])
def test_scripts_in_the_document_are_allowed_by_hash_even_if_it_has_not_changed(
    folder: Path | None,
) -> None:
    document = get("/", folder)
    again = get("/", folder, if_none_match=document.headers["etag"])
    assert again.status_code == 304
    for answer in (document, again):
        policy = answer.headers["content-security-policy"]
        assert "unsafe" not in policy
        for tag in ("script", "style"):
            [text] = re.findall(rf"<{tag}>(.*?)</{tag}>", document.text, re.DOTALL)
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            assert f"'sha256-{digest}'" in policy


@pytest.mark.parametrize("language", ["en", "es", "zh"])
def test_the_first_visit_is_small(language: str) -> None:
    wanted = {"page.css", "drive.js", f"{language}.js", "video-worker.js"}
    first = [data for address, data in files(joined_page()).items() if name_of(address) in wanted]
    html = (joined_page() / "index.html").read_bytes()
    sizes = [len(gzip.compress(data, 9)) for data in (html, *first)]
    assert len(sizes) == 1 + len(wanted)
    assert sum(sizes) <= 48_000, (
        "load later what the first screen does not need: sentences of a screen go into "
        "components/screens/messages, code behind import()"
    )


def test_a_clone_serves_the_modules_as_they_are_written() -> None:
    assert "'js/main.js'" in get("/", WEB).text
    assert get("/js/main.js", WEB).text == (WEB / "js/main.js").read_text("utf-8")
    assert "immutable" not in get("/js/main.js", WEB).headers.get("cache-control", "")
