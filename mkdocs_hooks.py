"""Hooks for mkdocs: adds pages from the root, expands folders in the menu, refuses other hosts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import griffe
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parent
FROM_ROOT = {
    "README.md": "index.md",
    **{name: name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")},
    **{name: name for name in ("CODE_OF_CONDUCT.md", "LICENSE", "CITATION.cff")},
    "web/icons/plate.svg": "images/plate.svg",
}
_FETCHED = re.compile(
    r"<(?:script|img|iframe|link)\b[^>]*?(?:src|href)=[\"']?((?:https?:)?//[^\"' >]+)"
    r"|(?:@import|url\()\s*[\"']?((?:https?:)?//[^\"')]+)"
)


class Examples(griffe.Extension):
    """Shows an `Example:` of a docstring as code; griffe itself does so only for `Examples:`."""

    def on_instance(self, *, obj: griffe.Object, **_: object) -> None:
        """Rename the section of one object."""
        if obj.docstring is not None:
            obj.docstring.value = re.sub(
                r"^( *)Example:$", r"\1Examples:", obj.docstring.value, flags=re.MULTILINE
            )


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Replace each folder in the navigation by its pages."""
    config.nav = [_expanded(entry, Path(config.docs_dir)) for entry in config.nav or []]
    return config


def _expanded(entry: Any, docs: Path) -> Any:
    if isinstance(entry, dict):
        ((title, inner),) = entry.items()
        folder = inner if isinstance(inner, str) and inner.endswith("/") else None
        return {title: _pages(docs, folder) if folder else _all(inner, docs)}
    return entry


def _all(inner: Any, docs: Path) -> Any:
    if not isinstance(inner, list):
        return inner
    pages: list[Any] = []
    for one in inner:
        is_folder = isinstance(one, str) and one.endswith("/")
        pages += _pages(docs, one) if is_folder else [_expanded(one, docs)]
    return pages


def _pages(docs: Path, folder: str) -> list[str]:
    files = sorted((docs / folder).glob("*.md"), key=lambda file: (file.stem != "README", file))
    return [file.relative_to(docs).as_posix() for file in files]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files at the root, with the README as the first page."""
    for name, uri in FROM_ROOT.items():
        text = (ROOT / name).read_text("utf-8")
        if name.endswith(".md"):
            text = re.sub(r"(\]\(|src=\")docs/", r"\1", text)
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Redirect links that leave `docs` to the pages that were added from the root."""
    up = "../" * page.file.src_uri.count("/")
    markdown = markdown.replace(f"](../{up}README.md", f"]({up}{FROM_ROOT['README.md']}")
    return markdown.replace(f"](../{up}", f"]({up}")


def on_post_build(config: MkDocsConfig) -> None:
    """Refuse a site whose pages fetch something from another host."""
    fetched = {
        f"{file.relative_to(config.site_dir)}: {one[0] or one[1]}"
        for kind in ("*.html", "*.css")
        for file in Path(config.site_dir).rglob(kind)
        for one in _FETCHED.findall(file.read_text("utf-8"))
    }
    if fetched:
        raise PluginError(
            "these pages would fetch files from other hosts: " + "; ".join(sorted(fetched))
        )
