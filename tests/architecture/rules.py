"""Rules for the source code as a whole; each reads a folder and returns the violations."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import defaultdict
from pathlib import Path

PACKAGES = ("robot", "server")


def modules(root: Path) -> list[Path]:
    """Return the modules of the product."""
    return sorted(file for package in PACKAGES for file in (root / package).rglob("*.py"))


def classes_used_twice(root: Path) -> dict[str, list[str]]:
    """Return public class names with several meanings, and their locations."""
    places = defaultdict(list)
    for file in modules(root):
        for node in ast.parse(file.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(file.relative_to(root).as_posix())
    return {name: files for name, files in places.items() if len(files) > 1}


def rooms(root: Path, package: str) -> set[str]:
    """Return the folders and modules directly in a package."""
    return {
        path.stem
        for path in (root / package).iterdir()
        if (path.suffix == ".py" and path.stem != "__init__") or (path / "__init__.py").is_file()
    }


def drawn_layers(root: Path, package: str) -> list[set[str]]:
    """Return the layers of a package in the map of the architecture page, top first."""
    page = (root / "docs/explanation/architecture.md").read_text("utf-8")
    found = re.search(rf"```layers {package}\n(.*?)```", page, re.DOTALL)
    assert found, f"the page has no map of {package}"
    return [set(line.split("  ")[0].split(" | ")) for line in found[1].splitlines() if line.strip()]


def contracted_layers(root: Path, package: str) -> list[set[str]]:
    """Return the layers of a package in the contract of pyproject.toml, top first."""
    settings = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))
    [layers] = [
        contract["layers"]
        for contract in settings["tool"]["importlinter"]["contracts"]
        if contract.get("containers") == [package]
    ]
    return [set(layer.split(" | ")) for layer in layers]
