"""The package index gets a page whose links lead somewhere, and true metadata."""

from __future__ import annotations

import re
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

import robot

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")
HOME = "https://forge.example/somebody/drivelesson/"
_TARGET = re.compile(r"""\]\(([^)]+)\)|src="([^"]+)\"""")


@pytest.fixture(scope="module")
def build() -> ModuleType:
    spec = spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _targets(page: str) -> list[str]:
    return [link or picture for link, picture in _TARGET.findall(page)]


def test_without_a_public_repository_the_package_page_has_no_relative_link(
    build: ModuleType,
) -> None:
    page = build.page(README, "", "1.2.3")
    assert _targets(page) == []
    assert "Tutorial: a robot that drives itself" in page and "<img" not in page
    assert build.urls("", "1.2.3") == {}


def test_with_a_public_repository_every_link_is_absolute_and_of_this_version(
    build: ModuleType,
) -> None:
    before, after = _targets(README), _targets(build.page(README, HOME, "1.2.3"))
    kinds = ["raw" if path.startswith("docs/images/") else "blob" for path in before]
    assert len(before) > 30
    assert after == [
        f"{HOME}{kind}/v1.2.3/{path}" for kind, path in zip(kinds, before, strict=True)
    ]
    assert all(url.startswith(HOME.rstrip("/")) for url in build.urls(HOME, "1.2.3").values())


def test_a_link_that_is_absolute_or_within_the_page_is_left_alone(build: ModuleType) -> None:
    text = "[a](https://a.example/b) [c](#d) ![e](https://a.example/f.png)"
    assert build.page(text, HOME, "1") == text == build.page(text, "", "1")


def test_the_classifiers_name_every_tested_python() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    told = re.findall(r"Python :: (3\.\d+)", " ".join(project["classifiers"]))
    release = (ROOT / ".github/workflows/release.yml").read_text("utf-8")
    tried = re.search(r"python: \[(.*)\]", release)
    assert tried is not None and [word.strip(' "') for word in tried[1].split(",")] == told
    assert f">={told[0]}" == project["requires-python"]


def test_the_citation_is_of_this_version_and_its_day() -> None:
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert changes.index("\n## Unreleased\n") < changes.index(f"\n## {robot.__version__} (")
    [day] = re.findall(rf"^## {re.escape(robot.__version__)} \(([\d-]+)\)$", changes, re.M)
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"version: {robot.__version__}\n" in citation
    assert f"date-released: {day}\n" in citation
