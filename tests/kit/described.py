"""Lists the routes that an application describes in `/openapi.json`, so that new routes are
included."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import httpx


class Described(NamedTuple):
    """One method of one path, with the fields of its JSON body and of its query."""

    method: str
    path: str
    fields: tuple[str, ...]
    query: tuple[str, ...]

    def at(self, value: str = "1") -> str:
        """Return the route's path with each parameter replaced by a value."""
        return re.sub(r"{\w+}", lambda _: value, self.path)


def described_routes(spec: dict[str, Any]) -> list[Described]:
    """Return every method of every path of an OpenAPI description."""
    found = []
    for path, methods in spec["paths"].items():
        for method, route in methods.items():
            content = route.get("requestBody", {}).get("content", {}).get("application/json", {})
            name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
            fields = spec["components"]["schemas"].get(name, {}).get("properties", {})
            query = [one["name"] for one in route.get("parameters", ()) if one["in"] == "query"]
            found.append(Described(method.upper(), path, tuple(fields), tuple(query)))
    return found


def readable_addresses(client: httpx.Client, *names: str) -> Iterator[str]:
    """Yield every address of a finite GET request. The first parameter takes each of these names
    and of the server's names; all other parameters are "1"."""
    listed = client.get("/api/episodes").text + client.get("/api/models").text
    named = sorted({"1", *names, *re.findall(r'"(?:id|name)":\s*"([\w-]+)"', listed)})
    for route in described_routes(client.get("/openapi.json").json()):
        if route.method == "GET" and route.path != "/video.mjpg":
            for name in named if "{" in route.path else [""]:
                yield re.sub(r"{\w+}", "1", re.sub(r"{\w+}", name, route.path, count=1))
