"""A real server survives nonsense: its memory stays small, and the loop continues.

Every route behaves as `/openapi.json` describes: bodies, answers and errors, with valid and
invalid values. DRIVELESSON_FUZZ sets the number of messages: 1,000, or 100,000 at full size.
"""

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
from hypothesis import HealthCheck, Phase, given, settings
from websockets.sync.client import ClientConnection, connect

from robot.store.folder import Storage
from server.protocol import encode_acknowledgement
from tests.kit.served import Served, served
from tests.kit.sizes import IS_FULL, size
from tests.robot.recordings.drives import record_drive
from tests.robot.store.models.test_checking import malformed

pytestmark = pytest.mark.realtime

MESSAGES = size("FUZZ", 1_000, 100_000)
EXAMPLES = size("EXAMPLES", 2, 250)
BATCH = 100
BODY_MB = 40
"""The largest body that the server accepts."""
COPIES = 4
"""Number of copies of that body that all hostile requests together may add to a started server.
While the server reads a body, two copies exist; allocators and Python versions keep up to one
more."""
UP: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "wire.json").read_text()
)["up"]
EDGES = (None, True, False, 0, 1, -1, 2**31, 2**32, 2**53, 2**64, -(10**30), 1e308, 0.5, "", [])
WHOLE = ("[" * 2000, "x" * 5000, '{"type":"ping","client_ms":1e999}', "\x00", "{}")


def nonsense(dice: random.Random) -> str | bytes:
    """Return random bytes, or random Unicode text, which no protocol expects."""
    some = dice.randbytes(dice.randrange(41))
    return dice.choice((some, some.decode("utf-16", "ignore"), dice.choice(WHOLE)))


def drive_message(dice: random.Random) -> str | bytes:
    """Return nonsense, or a message of a page with some values replaced."""
    if dice.random() < 0.4:
        return nonsense(dice)
    message = dice.choice(UP)
    others = {name: dice.choice(EDGES) for name in message if dice.random() < 0.3}
    return json.dumps({**message, **others})


@contextlib.contextmanager
def untouched(server: Served) -> Iterator[None]:
    """Fail if the loop stops, or if an error was logged.

    The loop's speed under load is not tested here: `drivelesson bench link` prints the loop's rate.
    """
    yield
    said = [line for line in server.errors if " ERROR " in line or "Traceback" in line]
    assert said == []
    before = server.metric("loop_turns_total")
    # otherwise the test's own time limit ends this loop
    while server.metric("loop_turns_total") < before + 10:
        time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.timeout(700)
@pytest.mark.filterwarnings("ignore")
def test_nonsense_messages_neither_fill_the_memory_nor_disturb_the_loop(tmp_path, capsys):
    record_drive(Storage(tmp_path).folder("episodes"), frames=20)
    with served(tmp_path) as server:
        begun_mb = peak_mb(server.process.pid)
        with untouched(server):
            answers = send_large_and_malformed_models(server)
        for send in (send_words, send_acknowledgements):
            with untouched(server):
                send(server)
        most_mb = peak_mb(server.process.pid)
        check_every_route_answers_what_the_description_states(server.address)
    with capsys.disabled():
        print(f"\n{len(answers)} hostile requests: {begun_mb:.0f} MB, at most {most_mb:.0f} MB")
    assert len(answers) > 5 and max(answers) < 500
    assert httpx.codes.TOO_MANY_REQUESTS not in answers, "a request was refused unread"
    assert most_mb < begun_mb + COPIES * BODY_MB


def peak_mb(pid: int) -> float:
    """Return the peak memory of a process, in MB."""
    return int(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0]) / 1024


def send_large_and_malformed_models(server: Served) -> list[int]:
    """Return the status of each answer; the tests in virtual time check them."""
    answers: list[int] = []
    with httpx.Client(base_url=server.address, timeout=60) as page:
        for learner in ("published-4", "default-6"):
            for what, data in malformed(learner, every=15 if IS_FULL else 120):
                answers.append(page.put("/api/models/x/file", content=data).status_code)
                assert answers[-1] == 422, what
        answers.append(page.put("/api/models/x/file", content=bytes(BODY_MB * 10**6)).status_code)
        answers.append(page.put(f"/api/models/{3_000 * 'x'}/file", content=b"x").status_code)
        assert page.get("/healthz").status_code == 200
    return answers


@contextlib.contextmanager
def sockets(server: Served, path: str) -> Iterator[list[ClientConnection]]:
    """Open six connections, because the server reads each one no faster than a page needs."""
    address = f"ws://127.0.0.1:{server.port}{path}"
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(connect(address, compression=None)) for _ in range(6)]


def send_words(server: Served) -> None:
    dice = random.Random(1)
    with sockets(server, "/ws/drive") as lines:
        for batch, socket in zip(range(int(0.7 * MESSAGES / BATCH)), itertools.cycle(lines)):
            for _ in range(BATCH):
                socket.send(drive_message(dice))
            _is_still_answered(socket, batch)
    assert server.metric('messages_refused_total{code="malformed"}') > MESSAGES / 10


def send_acknowledgements(server: Served) -> None:
    dice = random.Random(2)
    with sockets(server, "/ws/video") as lines:
        for _, socket in zip(range(int(0.25 * MESSAGES)), itertools.cycle(lines)):
            known = encode_acknowledgement(dice.randrange(2**32))
            socket.send(known if dice.random() < 0.3 else nonsense(dice))
        for socket in lines:
            assert isinstance(socket.recv(60), bytes)


def _is_still_answered(socket: ClientConnection, number: int) -> None:
    socket.send(json.dumps({"type": "ping", "client_ms": number}))
    while True:
        answer = json.loads(socket.recv(60))
        if answer["type"] == "pong" and answer["client_ms"] == number:
            return


def check_every_route_answers_what_the_description_states(address: str) -> None:
    schemathesis = pytest.importorskip("schemathesis")
    schema = schemathesis.openapi.from_url(address + "/openapi.json")
    operations = [result.ok() for result in schema.get_all_operations()]
    assert len(operations) > 50
    faults = [fault for operation in operations for fault in faults_of(operation)]
    assert not faults, "\n\n".join(faults)


def faults_of(operation: Any) -> list[str]:
    """Test an operation with all checks; return its faults."""
    from schemathesis.checks import CHECKS, load_all_checks
    from schemathesis.core.failures import FailureGroup

    load_all_checks()
    # The description cannot distinguish a model's bytes from other bytes, which answer 422.
    left_out = "positive_data_acceptance" if operation.path.endswith("/file") else ""
    checks = [check for check in CHECKS.get_all() if check.__name__ != left_out]
    faults = []

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy())
    def send(case: Any) -> None:
        try:
            case.call_and_validate(checks=checks)
        except FailureGroup as error:
            faults.append(f"{case.method} {case.path}: {error}"[:1500])

    send()
    return faults[:1]
