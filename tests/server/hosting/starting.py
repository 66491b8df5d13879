"""While the robot starts, the page names the missing part; then it leaves the sockets to the
server.

`test_real_server.py` checks it.
"""

from __future__ import annotations

import socket

from robot.clock import RealClock
from server.hosting.serving import open_socket
from server.hosting.starting_page import StartingPage, StartingPart


def ask(listener: socket.socket, request: bytes = b"GET / HTTP/1.1\r\n\r\n") -> bytes:
    with socket.create_connection(listener.getsockname()) as line:
        line.sendall(request)
        answer = b""
        while piece := line.recv(4096):
            answer += piece
        return answer


def check_it_names_what_is_still_starting_and_then_lets_the_server_answer() -> None:
    listener = open_socket("127.0.0.1", 0)
    with listener, StartingPage([listener], RealClock()) as page:
        assert ask(listener).startswith(b"HTTP/1.1 503 ")
        assert b"the program" in ask(listener)
        page.part = StartingPart.ROBOT
        assert b"the robot and its camera" in ask(listener)
        page.part = StartingPart.MODEL
        assert b"the robot's model" in ask(listener)
        with socket.create_connection(listener.getsockname()):
            pass  # a client that leaves at once delays nobody
        assert b"Retry-After" in ask(listener, b"\x16\x03\x01 no HTTP at all")

        page.stop()

        with socket.create_connection(listener.getsockname()) as line:
            listener.setblocking(True)
            accepted, _ = listener.accept()
            with accepted:
                accepted.sendall(b"served")
                assert line.recv(6) == b"served"
