"""Possible requests to a route: drawn from its description, with existing names and keys."""

from __future__ import annotations

import random
import string
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote


@dataclass
class Pool:
    """The known names on the server, to be used in requests."""

    names: list[str] = field(default_factory=lambda: ["bench", "other", "third"])
    episodes: list[str] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    model: bytes = b""


@dataclass(frozen=True)
class Route:
    """One method of one path, and its parameters."""

    method: str
    path: str
    parameters: tuple[dict[str, Any], ...]
    schema: dict[str, Any] | None
    is_upload: bool


def routes(spec: dict[str, Any]) -> list[Route]:
    """Return the routes of an OpenAPI description."""
    found = []
    for path, methods in spec["paths"].items():
        for method, described in methods.items():
            content = described.get("requestBody", {}).get("content", {})
            schema = content.get("application/json", {}).get("schema")
            found.append(
                Route(
                    method.upper(),
                    path,
                    tuple(described.get("parameters", ())),
                    schema,
                    "application/octet-stream" in content,
                )
            )
    return found


_VERBS = ("pin", "relabel", "delete", "undelete", "forget")
_TEXTS = {
    "verb": _VERBS,
    "colour": ("teal", "pink", "grey", "mauve"),
    "label": ("left", "right", "forward"),
    "learner": ("published-8", "default-32", "nothing"),
    "language": ("en", "es", "zh"),
    "world": ("box", "none"),
}


class Requests:
    """Draws requests."""

    def __init__(self, spec: dict[str, Any], dice: random.Random, pool: Pool) -> None:
        self._schemas = spec["components"]["schemas"]
        self.routes, self._dice, self._pool = routes(spec), dice, pool

    def target(self, route: Route) -> str:
        """Return a path with its query."""
        path, query = route.path, []
        for one in route.parameters:
            value = self._named(one["name"], one.get("schema", {}))
            if one["in"] == "path":
                path = path.replace(f"{{{one['name']}}}", quote(str(value), safe=""))
            elif one.get("required") or self._dice.random() < 0.7:
                query.append(f"{one['name']}={quote(str(value), safe='')}")
        return path + ("?" + "&".join(query) if query else "")

    def body(self, route: Route) -> Any:
        """Return the request's body: a value for JSON, bytes for a file, or None."""
        if route.is_upload:
            return self._pool.model if self._dice.random() < 0.8 else b"no model"
        if route.schema is None:
            return None
        return self._value("", route.schema)

    def _named(self, name: str, schema: dict[str, Any]) -> Any:
        pool, dice = self._pool, self._dice
        known: list[Any] | None = {
            "name": pool.names,
            "model": pool.names,
            "episode_id": pool.episodes,
            "episode": pool.episodes,
            "node": pool.nodes,
            "undo": pool.keys,
            "key": pool.keys,
        }.get(name)
        if known and dice.random() < 0.95:
            return dice.choice(known)
        return self._value(name, schema)

    def _value(self, name: str, schema: dict[str, Any]) -> Any:
        dice = self._dice
        if "$ref" in schema:
            schema = self._schemas[schema["$ref"].rsplit("/", 1)[1]]
        if "anyOf" in schema:
            schema = dice.choice(schema["anyOf"])
        if "enum" in schema:
            return dice.choice(schema["enum"])
        kind = schema.get("type")
        if kind == "object":
            needed = schema.get("required", ())
            return {
                key: self._named(key, inner)
                for key, inner in schema.get("properties", {}).items()
                if key in needed or dice.random() < 0.4
            }
        if kind == "array":
            inner = schema.get("items", {})
            return [self._named(name.rstrip("s"), inner) for _ in range(dice.randrange(3))]
        if kind == "boolean":
            return dice.random() < 0.5
        if kind in ("integer", "number"):
            low = schema.get("minimum", schema.get("exclusiveMinimum", 0))
            high = schema.get("maximum", low + 40)
            drawn = dice.uniform(low, high)
            return round(drawn) if kind == "integer" else drawn
        if kind == "string" or kind is None:
            if name in _TEXTS and dice.random() < 0.95:
                return dice.choice(_TEXTS[name])
            if name == "value":
                return dice.choice([True, False, "left", "right", 3, None])
            if name in ("name", "title", "place") or dice.random() < 0.5:
                return dice.choice([*self._pool.names, "fourth", "a title", "Wren"])
            return "".join(dice.choices(string.printable, k=dice.randrange(12)))
        return None
