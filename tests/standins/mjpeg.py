"""An IP camera on this machine, whose stream of JPEGs can be cut."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any, Self

from tests.kit.frames import grey_jpeg


class MjpegServer(HTTPServer):
    """A camera that streams about 30 pictures a second, unless it `refuses`."""

    def __init__(self, *, with_length: bool = True) -> None:
        super().__init__(("127.0.0.1", 0), _Stream)
        self.with_length = with_length
        self.ended = threading.Event()
        self.refuses = False
        self.asked: list[str] = []
        self._thread = threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/stream"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.ended.set()
        self.shutdown()
        self._thread.join()
        self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that disconnects is not an error here."""


class _Stream(BaseHTTPRequestHandler):
    server: MjpegServer

    def do_GET(self) -> None:
        server = self.server
        server.asked.append(self.headers.get("authorization", ""))
        if server.refuses:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("content-type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        index = 0
        while not server.ended.wait(0.03) and not server.refuses:
            index += 1
            jpeg = grey_jpeg(index)
            length = f"Content-Length: {len(jpeg)}\r\n" if server.with_length else ""
            head = f"--frame\r\nContent-Type: image/jpeg\r\n{length}\r\n"
            self.wfile.write(head.encode() + jpeg + b"\r\n")
            if not server.with_length:
                self.wfile.write(b"--frame")

    def log_message(self, format: str, *args: object) -> None:
        pass
