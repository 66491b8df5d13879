"""A stand-in for mybot on this machine. Tests can ask the stand-in whether it moves."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from drivelesson_mybot import MybotDriver, MybotOptions

from robot.testing.cases import DriverCase


class Mybot(ThreadingHTTPServer):
    """A robot that moves until the time of its move is over; with `is_silent` it no longer
    answers."""

    moves_until_s = 0.0
    is_silent = False

    def is_moving(self) -> bool:
        return time.monotonic() < self.moves_until_s


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    server: Mybot

    def do_GET(self) -> None:
        if self.server.is_silent:
            self.close_connection = True
            return
        asked = urlsplit(self.path)
        if asked.path == "/move":
            seconds = int(parse_qs(asked.query)["ms"][0]) / 1000
            self.server.moves_until_s = time.monotonic() + seconds
        elif asked.path == "/stop":
            self.server.moves_until_s = 0.0
        body = json.dumps({"distance_m": 1.0}).encode()
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        pass


@contextmanager
def stand_in() -> Iterator[DriverCase]:
    with Mybot(("127.0.0.1", 0), Handler) as robot:
        driver = MybotDriver(MybotOptions(mybot_address=f"127.0.0.1:{robot.server_port}"))
        thread = threading.Thread(target=robot.serve_forever, args=(0.02,))
        thread.start()

        cut_link, restore_link = (partial(setattr, robot, "is_silent", on) for on in (True, False))
        try:
            yield DriverCase(
                driver, time.sleep, robot.is_moving, cut_link, restore_link=restore_link
            )
        finally:
            robot.is_silent = False
            driver.disconnect()
            robot.shutdown()
            thread.join()


def pytest_drivelesson_driver(name: str) -> AbstractContextManager[DriverCase] | None:
    return stand_in() if name == "mybot" else None
