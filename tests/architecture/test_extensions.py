"""Each extension can be removed without a trace, together with the extensions that need it.

A server boots in memory from a tree without the extension, and the core does not contain the
extension's words.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import robot
from tests.kit.sizes import IS_FULL
from web.bundle import bundle

from .extensions import (
    CORE_DOCUMENTS,
    EXTENSIONS,
    NEEDS,
    PACKAGES,
    ROOT,
    WEB,
    extension_of,
    modules,
)


def gone_with(extensions: set[str]) -> set[str]:
    """Return the given extensions and all extensions that need one of them."""
    gone, before = extensions, set[str]()
    while gone != before:
        before, gone = gone, gone | {name for name, needs in NEEDS.items() if gone & {*needs}}
    return gone


def packages_of(extensions: set[str]) -> set[str]:
    """Return the packages of extensions."""
    return {f"{package}.{name}" for package in PACKAGES for name in extensions}


REMOVALS = [{e} for e in EXTENSIONS] if IS_FULL else [{*EXTENSIONS[i::4]} for i in range(4)]
"""Sets of extensions that are removed together: with DRIVELESSON_FULL=1 each extension by itself,
otherwise four groups, which take a quarter of the time."""


def place(source: str, target: str) -> None:
    """Link a file, or copy it if the folder is on another disk. Linking is faster, which matters,
    because each tree has a thousand files."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def copy_without(extensions: set[str], folder: Path, *names: str) -> None:
    """Copy the tree without extensions."""
    gone = packages_of(extensions)
    # compiled modules are linked, too, which saves a second
    ignored = shutil.ignore_patterns("node_modules", "*.webp")
    for name in names:
        shutil.copytree(ROOT / name, folder / name, ignore=ignored, copy_function=place)
    for package in gone:
        shutil.rmtree(folder / package.replace(".", "/"), ignore_errors=True)
    for extension in extensions:
        for page in WEB.get(extension, ()):
            shutil.rmtree(folder / "web" / page, ignore_errors=True)
    named = folder / "web/js/extensions.js"
    if named.exists():
        lines = named.read_text("utf-8").splitlines(keepends=True)
        rooms = [page for each in extensions for page in WEB.get(each, ())]
        gone_lines = {f"import './{room.removeprefix('js/')}/extension.js';\n" for room in rooms}
        named.unlink()  # the tree gets its own version of this file
        named.write_text("".join(line for line in lines if line not in gone_lines), "utf-8")
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    taken = "|".join(map(re.escape, sorted(gone)))
    text = re.sub(rf'^[\w-]+ = "(?:{taken})[.:].*\n', "", text, flags=re.MULTILINE)
    (folder / "pyproject.toml").write_text(text, "utf-8")
    groups = tomllib.loads(text)["project"]["entry-points"]
    installed = folder / "drivelesson-0.dist-info"
    installed.mkdir()
    about = f"Metadata-Version: 2.1\nName: drivelesson\nVersion: {robot.__version__}\n"
    (installed / "METADATA").write_text(about)
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in points.items())]
    (installed / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture(scope="module")
def booted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """The core's content without each extension: `boot.py` starts all trees, one after another."""
    if not hasattr(os, "fork"):
        pytest.skip("this system cannot fork")
    folders = []
    for removed in REMOVALS:
        folders.append(folder := tmp_path_factory.mktemp("without"))
        copy_without(gone_with(removed), folder, *PACKAGES)
        (folder / "web").symlink_to(ROOT / "web")
    script = Path(__file__).with_name("boot.py")
    command = [sys.executable, script, *map(str, folders)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, [line.get("error") for line in lines] + [done.stderr[-2000:]]
    return {
        extension: {**line, "gone": gone_with(removed)}
        for removed, line in zip(REMOVALS, lines, strict=True)
        for extension in removed
    }


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_the_core_boots_without_each_extension(
    extension: str, booted: dict[str, dict[str, Any]]
) -> None:
    boot = booted[extension]
    gone = boot["gone"]
    assert "/api/stop" in boot["paths"] and "/api/settings" in boot["paths"]
    left = {f"{name}." for name in boot["modules"]}
    assert not [name for name in left if name.startswith(tuple(f"{e}." for e in packages_of(gone)))]
    commands = {
        "board": "board",
        "study": "study",
        "evaluate": "lab",
        "episodes": "recordings",
        "brick": "bodies",
        "completion": "integrations",
    }
    paths = {
        "/api/gallery": "coaching",
        "/api/challenge": "challenge",
        "/api/world": "simulator",
        "/metrics": "integrations",
        "/api/models": "library",
        "/api/pair": "access",
        "/api/episodes": "recordings",
        "/api/session": "study",
    }
    for kind, homes in {"commands": commands, "paths": paths}.items():
        for name, home in homes.items():
            assert (name in boot[kind]) is (home not in gone), name


def test_the_need_for_a_removed_extension_is_reported(booted: dict[str, dict[str, Any]]) -> None:
    assert "needs the extension 'access'" in booted["access"]["unreachable"]
    assert "choose a robot with --robot NAME: one of " in booted["simulator"]["no_robot"]
    assert "models" in booted["recordings"]["folders"]
    assert "episodes" not in booted["recordings"]["folders"]


WORDS = {
    "access": r"pairing|paired|certificat|behind-proxy|admission|mdns",
    "board": r"teacher|classroom|pupil|class_key",
    "bodies": r"\bev3\b(?!dev)|pybricks|gymnasium|the robot's eye|\"phone\"",
    "challenge": r"robot\.challenge|server\.challenge|/api/challenge",
    "coaching": r"readiness|\bgallery\b|\btrail\b|coach",
    "adjustments": r"/api/corrections|CorrectionsFile|corrections\.json|BodyCorrection|swap_sides",
    "devkit": r"\bdevkit\b|ConnectedDriver|WatchedCamera|UsbCamera",
    "exchange": r"donkeycar|lerobot",
    "lab": r"ablation|benchmark",
    "library": r"/api/models|LibraryExtension|ModelLibrary",
    "integrations": r"fast ?path|prometheus|/metrics|render_metrics|\bVLC\b|x-mixed-replace",
    "recordings": r"episode|recorder",
    "simulator": r"simulator|--robot sim|simulation",
    "study": r"\bstud(y|ies)\b|participant|questionnaire",
    "testing": r"(?<!>>> )from robot\.testing|import robot\.testing",
}
"""Words that belong only to an extension."""


PAGE_WORDS = {
    "access": r"\bpair(ing|ed)\b|api/pair|\('pair'\)",
    "board": r"teacher|classroom|pupil|\bboard\b|\b(a|the) class\b(?! [A-Z])|class's",
    "bodies": r"\beyes?\b",
    "challenge": r"challenge",
    "coaching": r"api/teaching/|api/why|'(gallery|gap|ready|undo|why)\.",
    "library": r"api/models",
    "recordings": r"api/episode|recorder|retraining",
    "simulator": r"simulated|--robot sim",
    "study": r"\bstud(y|ies)\b|\bsession\b|participant",
}
"""Words that belong only to an extension's part of the page, and to its documents."""


def of_the_core(kind: str) -> list[Path]:
    """Return the modules or files of `web` that no extension owns, or the documents about the
    core."""
    if kind == "docs":
        return [ROOT / "docs" / name for name in CORE_DOCUMENTS]
    if kind == "code":
        every = modules(ROOT)
        return [file for file in every if extension_of(file.relative_to(ROOT)) == "core"]
    owned = [ROOT / "web" / folder for folders in WEB.values() for folder in folders]
    texts = [path for path in (ROOT / "web").rglob("*") if path.suffix in (".js", ".css", ".html")]
    named = ROOT / "web/js/extensions.js"
    return [p for p in texts if p != named and not any(p.is_relative_to(o) for o in owned)]


@pytest.mark.parametrize(
    ("kind", "words"), [("code", WORDS), ("web", PAGE_WORDS), ("docs", PAGE_WORDS)]
)
def test_the_core_says_no_word_of_an_extension(kind: str, words: dict[str, str]) -> None:
    patterns = {name: re.compile(word, re.IGNORECASE) for name, word in words.items()}
    files = of_the_core(kind)
    assert files
    said = [
        f"{name}: {file.relative_to(ROOT)}:{number}: {line.strip()[:120]}"
        for file in files
        for number, line in enumerate(file.read_text("utf-8").splitlines(), 1)
        for name, pattern in patterns.items()
        if pattern.search(line)
    ]
    assert said == []


@pytest.mark.parametrize("removed", REMOVALS, ids=lambda removed: "+".join(sorted(removed)))
def test_the_page_is_bundled_without_each_extension(removed: set[str], tmp_path: Path) -> None:
    copy_without(removed, tmp_path, "web")
    bundle(tmp_path / "web", tmp_path / "page")  # refuses an import of a removed module
    drive = next((tmp_path / "page/js").glob("*-drive.js")).read_text("utf-8")
    for folder in (folder for extension in removed for folder in WEB.get(extension, ())):
        assert f"'{folder}/" not in drive
        assert (ROOT / "web" / folder).is_dir()
