"""A load generator that sends all requests that a viewer is allowed to send, as fast as it can.
Usage: `greedy PORT COOKIE`."""

from __future__ import annotations

import http.client
import itertools
import json
import sys
from urllib.parse import quote

_ENDLESS = "/video.mjpg"


def readable(description: bytes, models: bytes) -> list[str]:
    """Return every path that a viewer can read, according to the server's `/openapi.json`."""
    paths = json.loads(description)["paths"]
    found = [path for path, ways in paths.items() if "get" in ways and path != _ENDLESS]
    names = [quote(one["name"], safe="") for one in json.loads(models).get("models", [])]
    return [path for path in found if "{" not in path] + [
        path.format(name=name)
        for path, name in itertools.product(found, names)
        if path.count("{") == 1 and "{name}" in path
    ]


def main(port: int, cookie: str) -> None:
    """Send requests until killed."""
    line = http.client.HTTPConnection("127.0.0.1", port)

    def read(path: str) -> bytes:
        line.request("GET", path, headers={"cookie": cookie})
        return line.getresponse().read()

    paths = readable(read("/openapi.json"), read("/api/models"))
    for path in itertools.cycle(paths):
        try:
            read(path)
        except (OSError, http.client.HTTPException):
            line.close()  # the server evicted the connection; the next request reconnects


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
