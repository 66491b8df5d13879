"""Thousands of nonsense messages over real sockets: the server answers, its memory stays small, and
the loop continues.

DRIVELESSON_FUZZ is the number of messages; `make test` sends 1,000, CI 100,000.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import ClientConnection, connect

from robot.store.folder import Storage
from server.protocol import encode_acknowledgement
from tests.kit.sizes import IS_FULL, combined, size
from tests.robot.recordings.drives import record_drive
from tests.robot.store.models.test_checking import malformed

from .described_routes import check_every_route_answers_what_the_description_states
from .own_process import OwnProcess, own_process

pytestmark = pytest.mark.realtime

MESSAGES = size("FUZZ", 1_000, 100_000)
BATCH = 100
BODY_MB = 40
"""The largest body that the server accepts."""
COPIES = 4
"""Number of copies of that body that all hostile requests together may add to a started server. Two
exist while one is read; allocators and Python versions keep up to one more."""

VALUES = (
    '"\\ud83d"', '"Kitchen \\ud83d"', '"' + "x" * 10_000 + '"', "NaN", "Infinity", "-1", "1e400",
    "9" * 5_000, "null", "true", "[]", "{}", '[["x"]]', '""', '"default-999999"', '"../../x"',
    '"\\u0000"', "-0", '"CON"', '"\\u202e"',
)  # fmt: skip
BODIES = [
    ("POST", "/api/models", "name"), ("POST", "/api/models", "learner"),
    ("POST", "/api/models", "place"), ("POST", "/api/models", "like"),
    ("POST", "/api/models/restore", "undo"),
    ("PATCH", "/api/models/bench", "name"), ("PATCH", "/api/models/bench", "place"),
    ("POST", "/api/models/bench/copy", "name"), ("POST", "/api/episodes/restore", "undo"),
    ("PATCH", "/api/episodes/ID", "title"), ("PATCH", "/api/episodes/ID", "protected"),
    ("POST", "/api/episodes/ID/edits", "verb"), ("POST", "/api/episodes/ID/edits", "first"),
    ("POST", "/api/episodes/ID/edits", "last"), ("POST", "/api/episodes/ID/edits", "label"),
    ("POST", "/api/teaching/undo", "seconds"),
]  # fmt: skip
PATHS = [
    ("GET", "/api/models/NAME/preview"), ("GET", "/api/models/NAME/file"),
    ("POST", "/api/models/NAME/load"), ("DELETE", "/api/models/NAME"),
    ("GET", "/api/episodes/NAME"), ("GET", "/api/episodes/NAME/timeline"),
    ("GET", "/api/episodes/NAME/frames/1"), ("GET", "/api/episodes/NAME/file"),
    ("DELETE", "/api/episodes/NAME"), ("POST", "/api/episodes/NAME/compact"),
    ("GET", "/api/episodes/ID/frames/NAME"), ("GET", "/api/episodes/ID/timeline?count=NAME"),
    ("GET", "/api/teaching/last?seconds=NAME"),
]  # fmt: skip

TYPES = ("drive", "mode", "stop", "release", "take", "yield", "ping")
KNOWN = {
    "type": TYPES,
    "held": ("forward", "left", "right", "stop"),
    "frame": (),
    "frame_age_ms": (),
    "mode": ("stopped", "train", "autonomous"),
    "seq": (1, 7, 1000),
    "client_ms": (),
    "stop_number": (),
}
"""The fields of a message, and their valid values."""
EDGES = (None, True, False, 0, 1, -1, 2**31, 2**32, 2**53, 2**64, -(10**30), 1e308, 0.5, "", [])
WHOLE = ("[" * 2000, "x" * 5000, '{"type":"ping","client_ms":1e999}', "\x00", "{}")


def text(dice: random.Random, most: int) -> str:
    """Return letters of all planes; no protocol expects most of them."""
    planes = (128, 128, 0x800, 0xD800, 0x10_FFFF)
    points = (dice.randrange(dice.choice(planes)) for _ in range(dice.randrange(most + 1)))
    return "".join(chr(point) for point in points if not 0xD800 <= point < 0xE000)


def anything(dice: random.Random) -> Any:
    """Return a JSON value of any kind."""
    kind = dice.randrange(8)
    if kind == 0:
        return text(dice, 8)
    if kind == 1:
        return [dice.randrange(-(2**40), 2**40) for _ in range(dice.randrange(4))]
    if kind == 2:
        return dice.randrange(-(2**70), 2**70)
    return dice.choice(EDGES)


def drive_message(dice: random.Random) -> str | bytes:
    """Return a nearly valid message, or nonsense."""
    kind = dice.randrange(8)
    if kind == 0:
        return text(dice, 40)
    if kind == 1:
        return dice.randbytes(dice.randrange(41))
    if kind == 2:
        return dice.choice(WHOLE)
    fields = {}
    for name, right in KNOWN.items():
        chance = dice.random()
        if chance < 0.4 and right:
            fields[name] = dice.choice(right)
        elif chance < 0.7:
            fields[name] = anything(dice)
    return json.dumps(fields)


def video_message(dice: random.Random) -> str | bytes:
    """Return bytes that may be an acknowledgement of any picture."""
    kind = dice.randrange(3)
    if kind == 0:
        return dice.randbytes(dice.randrange(25))
    return encode_acknowledgement(dice.randrange(2**32)) if kind == 1 else text(dice, 8)


@contextlib.contextmanager
def untouched(server: OwnProcess) -> Iterator[None]:
    """Fail if the loop stops, or if an error was logged.

    Its speed under load is a report: `drivelesson bench link` prints the loop's rate.
    """
    yield
    said = [line for line in server.errors if " ERROR " in line or "Traceback" in line]
    assert said == []
    before = _turns(server)
    while _turns(server) < before + 10:  # the test's own time limit ends a stalled loop
        time.sleep(0.05)


def _turns(server: OwnProcess) -> float:
    return server.metric("loop_turns_total")


@pytest.mark.slow
@pytest.mark.timeout(700)
@pytest.mark.filterwarnings("ignore")
def test_nonsense_messages_neither_fill_the_memory_nor_disturb_the_loop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_drive(Storage(tmp_path).folder("episodes"), frames=20)
    with own_process(tmp_path) as server:
        begun_mb = peak_mb(server.process.pid)
        with untouched(server):
            answers = send_hostile_values_and_malformed_models(server)
        for send in (send_words, send_acknowledgements):
            with untouched(server):
                send(server)
        most_mb = peak_mb(server.process.pid)
        check_every_route_answers_what_the_description_states(server.address)
    with capsys.disabled():
        print(f"\n{len(answers)} hostile requests: {begun_mb:.0f} MB, at most {most_mb:.0f} MB")
    assert len(answers) > 50 and max(answers) < 500
    assert httpx.codes.TOO_MANY_REQUESTS not in answers, "turned away before anything was read"
    assert most_mb < begun_mb + COPIES * BODY_MB


def peak_mb(pid: int) -> float:
    """Return the peak memory of a process, in MB."""
    return int(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0]) / 1024


def send_hostile_values_and_malformed_models(server: OwnProcess) -> list[int]:
    """Return the status of each answer; the tests in virtual time check them."""
    answers: list[int] = []
    with httpx.Client(base_url=server.address, timeout=60) as page:
        for learner in ("published-4", "default-6"):
            for what, data in malformed(learner, every=15 if IS_FULL else 60):
                answers.append(page.put("/api/models/x/file", content=data).status_code)
                assert answers[-1] == 422, what
        answers.append(page.put("/api/models/x/file", content=bytes(BODY_MB * 10**6)).status_code)
        for (method, path, field), value in combined(BODIES, VALUES):
            body = f'{{"{field}": {value}}}'.encode()
            answers.append(page.request(method, path, content=body).status_code)
        for method, path in PATHS:
            answers.append(page.request(method, path.replace("NAME", "x" * 3_000)).status_code)
        assert page.get("/healthz").status_code == 200
    return answers


@contextlib.contextmanager
def sockets(server: OwnProcess, path: str) -> Iterator[list[ClientConnection]]:
    """Open six connections; one is read no faster than a page needs."""
    address = f"ws://127.0.0.1:{server.port}{path}"
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(connect(address, compression=None)) for _ in range(6)]


def send_words(server: OwnProcess) -> None:
    dice = random.Random(1)
    with sockets(server, "/ws/drive") as lines:
        for batch, socket in zip(range(int(0.7 * MESSAGES / BATCH)), itertools.cycle(lines)):
            for _ in range(BATCH):
                socket.send(drive_message(dice))
            _is_still_answered(socket, batch)
    assert server.metric('messages_refused_total{code="malformed"}') > MESSAGES / 10


def send_acknowledgements(server: OwnProcess) -> None:
    dice = random.Random(2)
    with sockets(server, "/ws/video") as lines:
        for _, socket in zip(range(int(0.25 * MESSAGES)), itertools.cycle(lines)):
            socket.send(video_message(dice))
        for socket in lines:
            assert isinstance(socket.recv(60), bytes)


def _is_still_answered(socket: ClientConnection, number: int) -> None:
    socket.send(json.dumps({"type": "ping", "client_ms": number}))
    while True:
        answer = json.loads(socket.recv(60))
        if answer["type"] == "pong" and answer["client_ms"] == number:
            return
