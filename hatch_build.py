"""Gives a wheel its page, joined, and the package its page on an index.

The page is joined by `web/bundle.py`. The other is the README, with links that lead somewhere from
there: one setting, `repository` in pyproject.toml, is the project's public address. While it is
empty a relative link becomes its text, and a picture is left out (docs/adr/0031).
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

_LINK = re.compile(r"(?<!!)\[([^]]*)\]\((?!\w+:|#)([^)\s]+)\)")
_PICTURE = re.compile(
    r'<img [^>]*?src="(?!\w+:)([^"]+)"[^>]*>\n*|!\[[^]]*\]\((?!\w+:)([^)\s]+)\)\n*'
)


def page(readme: str, repository: str, version: str) -> str:
    """Return the README as an index can show it."""
    if not repository:
        return _LINK.sub(r"\1", _PICTURE.sub("", readme))
    base = f"{repository.rstrip('/')}/{{}}/v{version}/"

    def absolute(picture: re.Match[str]) -> str:
        path = picture[1] or picture[2]
        return picture[0].replace(path, base.format("raw") + path)

    return _LINK.sub(rf"[\1]({base.format('blob')}\2)", _PICTURE.sub(absolute, readme))


def urls(repository: str, version: str) -> dict[str, str]:
    """Return the project's own addresses, if it has any."""
    if not (base := repository.rstrip("/")):
        return {}
    return {
        "Source": base,
        "Documentation": f"{base}/blob/v{version}/README.md#documents",
        "Changes": f"{base}/blob/v{version}/CHANGELOG.md",
        "Issues": f"{base}/issues",
        "Security": f"{base}/security/policy",
    }


class CustomMetadataHook(MetadataHookInterface):
    """What hatchling asks for the dynamic part of the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the README and the addresses."""
        repository, version = self.config["repository"], metadata["version"]
        readme = (Path(self.root) / "README.md").read_text("utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": page(readme, repository, version),
        }
        metadata["urls"] = {**urls(repository, version), **self.config["urls"]}


class CustomBuildHook(BuildHookInterface[Any]):
    """Joins the page's modules; an editable installation serves them as they are written."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put the joined page into the wheel."""
        if version == "editable":
            return
        sys.path.insert(0, self.root)
        from web.bundle import bundle

        self._made = tempfile.TemporaryDirectory()
        page = Path(self._made.name) / "web"
        bundle(Path(self.root) / "web", page)
        build_data["force_include"][str(page)] = "server/web"
