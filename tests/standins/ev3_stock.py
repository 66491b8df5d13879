"""A simulated brick with LEGO's firmware on this machine: beacon, unlock and direct commands.

The simulated brick has its own reader of bytecodes, and shares no code with the driver's codec. The
third-party client `ev3-dc` checks the simulated brick (tests/robot/bodies/ev3/test_stock.py), which
in turn checks our driver.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import BinaryIO, Self

SERIAL = "0016533f0c1e"
LARGE, TOUCH, ULTRASONIC, NOTHING = 7, 16, 30, 126


class Motor:
    """A motor that turns at a percentage until its time is over."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self.percent, self.ends_s, self.count = 0, 0.0, 0.0
        self.polarity, self.resets = 1, 0

    @property
    def is_moving(self) -> bool:
        return self.percent != 0 and self._now_s() < self.ends_s

    def turn_for(self, percent: int, run_ms: int) -> None:
        self.percent, self.ends_s = percent, self._now_s() + run_ms / 1000


def _bind() -> tuple[socket.socket, socket.socket]:
    """Bind both sockets to one port of four digits, on which clients also answer the beacon."""
    for port in range(5555, 10_000):
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            server = stack.enter_context(socket.create_server(("127.0.0.1", port)))
            beacon = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            beacon.bind(("127.0.0.1", port))
            beacon.settimeout(0.05)
            stack.pop_all()
            return server, beacon
    raise AssertionError("no port is free")


class StockFirmware:
    """Executes direct commands like the firmware, on any clock; once `frozen`, it does nothing.

    Args:
        now_s: The clock.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self.motors = [Motor(now_s) for _ in range(4)]
        self.devices = {0: TOUCH, 3: ULTRASONIC, 0x11: LARGE, 0x12: LARGE}
        self.values = {TOUCH: 0.0, ULTRASONIC: 42.0}
        self.messages: list[bytes] = []
        self.frozen = threading.Event()

    @property
    def is_moving(self) -> bool:
        return any(motor.is_moving for motor in self.motors)

    @property
    def wheels(self) -> tuple[float, float]:
        """The motion of the motors at the usual ports, in percent."""
        left, right = (motor.percent * motor.is_moving for motor in self.motors[1:3])
        return left, right

    def answer(self, message: bytes) -> bytes | None:
        """Obey one direct command; return the answer if one is wanted."""
        _, count, kind, sizes = struct.unpack_from("<HHBH", message)
        results = bytearray(sizes & 0x3FF)
        ok = True
        if not self.frozen.is_set():
            try:
                _Machine(self, message[7:], results).run()
            except (IndexError, ValueError):
                ok = False
        if kind & 0x80:
            return None
        return struct.pack("<HHB", 3 + len(results), count, 2 if ok else 4) + bytes(results)


class StockBrick(StockFirmware):
    """Serves the brick on loopback; once `frozen`, it answers nothing.

    Args:
        beacon_port: The port of its announcements; 0 for a free port.
    """

    def __init__(self, beacon_port: int = 0) -> None:
        super().__init__()
        self._ending, self._unlocked = threading.Event(), threading.Event()
        self._server, self._beacon = _bind()
        self._client = self._server
        if beacon_port == 0:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("127.0.0.1", 0))
                beacon_port = probe.getsockname()[1]
        self.beacon_port = beacon_port
        self._threads = [
            threading.Thread(target=target, daemon=True) for target in (self._announce, self._serve)
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ending.set()
        for waiting in (self._server, self._client):
            with contextlib.suppress(OSError):
                waiting.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        self._server.close()
        self._beacon.close()

    def _announce(self) -> None:
        port = self._server.getsockname()[1]
        text = f"Serial-Number: {SERIAL}\r\nPort: {port}\r\nName: EV3\r\nProtocol: EV3\r\n"
        while not self._ending.is_set():
            if not self.frozen.is_set():
                self._beacon.sendto(text.encode(), ("127.0.0.1", self.beacon_port))
            with contextlib.suppress(OSError):
                self._beacon.recvfrom(64)
                self._unlocked.set()

    def _serve(self) -> None:
        while not self._ending.is_set():
            with contextlib.suppress(OSError):
                self._client, _ = self._server.accept()
                with self._client, self._client.makefile("rb") as stream:
                    if not self._ending.is_set():
                        self._talk(self._client, stream)

    def _talk(self, client: socket.socket, stream: BinaryIO) -> None:
        head = client.recv(1024).replace(b":", b"")
        is_meant = b"VMTP1.0" in head and SERIAL.encode() in head.lower()
        if not (self._unlocked.wait(2.0) and is_meant):
            return
        client.sendall(b"Accept:EV340\r\n\r\n")
        while size := stream.read(2):
            message = size + stream.read(struct.unpack("<H", size)[0])
            self.messages.append(message)
            answer = self.answer(message)
            if answer is not None and not self.frozen.is_set():
                client.sendall(answer)


class _Machine:
    """Reads bytecodes one after the other, by the firmware's documents."""

    def __init__(self, brick: StockFirmware, codes: bytes, results: bytearray) -> None:
        self.brick, self.codes, self.results, self.at = brick, codes, results, 0

    def run(self) -> None:
        while self.at < len(self.codes):
            opcode = self.codes[self.at]
            self.at += 1
            handler = getattr(self, f"op_{opcode:02x}", None)
            if handler is None:
                raise ValueError(f"opcode {opcode:#x}")
            handler()

    def parameter(self) -> int:
        """Read a constant, or the index of a global variable."""
        head = self.codes[self.at]
        self.at += 1
        if head < 0x40:
            return head - 0x40 if head & 0x20 else head
        if head & 0xE0 == 0x60:
            return head & 0x1F
        size, form = {0x81: (1, "b"), 0x82: (2, "<h"), 0x83: (4, "<i"), 0xE1: (1, "B")}[head]
        self.at += size
        return int(struct.unpack(form, self.codes[self.at - size : self.at])[0])

    def parameters(self, count: int) -> list[int]:
        return [self.parameter() for _ in range(count)]

    def chosen(self, ports: int) -> list[Motor]:
        return [motor for place, motor in enumerate(self.brick.motors) if ports >> place & 1]

    def op_af(self) -> None:  # TIME_SPEED
        _, ports, percent, up_ms, run_ms, down_ms, _ = self.parameters(7)
        for motor in self.chosen(ports):
            percent = max(-100, min(100, percent))
            motor.turn_for(percent * motor.polarity, up_ms + run_ms + down_ms)

    def op_a3(self) -> None:  # STOP
        _, ports, _ = self.parameters(3)
        for motor in self.chosen(ports):
            motor.percent = 0

    def op_a6(self) -> None:  # START
        self.parameters(2)

    def op_a2(self) -> None:  # RESET
        _, ports = self.parameters(2)
        for motor in self.chosen(ports):
            motor.count, motor.resets = 0.0, motor.resets + 1

    def op_a7(self) -> None:  # POLARITY
        _, ports, polarity = self.parameters(3)
        for motor in self.chosen(ports):
            motor.polarity = polarity or -motor.polarity

    def op_b3(self) -> None:  # GET_COUNT
        _, port, to = self.parameters(3)
        struct.pack_into("<i", self.results, to, int(self.brick.motors[port].count))

    def op_99(self) -> None:  # INPUT_DEVICE
        sub = self.parameter()
        _, port = self.parameters(2)
        kind = self.brick.devices.get(port, NOTHING)
        if sub == 0x05:
            for to, value in zip(self.parameters(2), (kind, 0), strict=True):
                self.results[to] = value
        elif sub == 0x1D:
            asked, _, count, to = self.parameters(4)
            value = self.brick.values[kind] if asked in (0, kind) and count == 1 else float("nan")
            struct.pack_into("<f", self.results, to, value)
        else:
            raise ValueError(f"INPUT_DEVICE {sub:#x}")

    def op_81(self) -> None:  # UI_READ
        sub, to = self.parameters(2)
        if sub == 0x12:
            self.results[to] = 80
        elif sub in (0x01, 0x02):
            struct.pack_into("<f", self.results, to, 7.5 if sub == 0x01 else 0.2)
        else:
            raise ValueError(f"UI_READ {sub:#x}")

    def op_82(self) -> None:  # UI_WRITE
        if self.parameters(2)[0] != 0x1B:
            raise ValueError("UI_WRITE")
