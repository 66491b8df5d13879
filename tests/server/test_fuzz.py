"""Nonsense by the thousand, over real sockets: the server answers, and the loop does not notice.

DRIVELESSON_FUZZ says how many messages; `make test` sends 4,000, CI 100,000.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from websockets.sync.client import ClientConnection, connect

from server.protocol import encode_acknowledgement

from .own_process import OwnProcess, own_process

pytestmark = pytest.mark.realtime

MESSAGES = int(os.environ.get("DRIVELESSON_FUZZ", "4000"))
BATCH = 100
_ENDLESS = """
[limits]
messages_per_second = 1e12
messages_burst = 1e12
frames_per_second = 1e12
refused_before_closing = 1_000_000_000
requests_burst = 1e12
requests_per_second = 1e12
"""

anything = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from([0, 1, -1, 2**31, 2**32, 2**53, 2**64, 1e308, 0.5]),
    st.text(max_size=8),
    st.lists(st.integers(), max_size=3),
)
words = st.fixed_dictionaries(
    {},
    optional={
        "type": st.one_of(
            st.sampled_from(["drive", "mode", "stop", "release", "take", "yield", "ping"]),
            anything,
        ),
        "held": st.one_of(st.sampled_from(["forward", "left", "right", "stop"]), anything),
        "frame": anything,
        "frame_age_ms": anything,
        "mode": st.one_of(st.sampled_from(["stopped", "train", "autonomous"]), anything),
        "seq": st.one_of(st.integers(1, 1000), anything),
        "client_ms": anything,
    },
)
drive_messages = st.one_of(
    words.map(json.dumps),
    st.text(max_size=40),
    st.binary(max_size=40),
    st.sampled_from(["[" * 2000, "x" * 5000, '{"type":"ping","client_ms":1e999}', "\x00", "{}"]),
)
video_messages = st.one_of(
    st.binary(max_size=24),
    st.integers(0, 2**32 - 1).map(encode_acknowledgement),
    st.text(max_size=8),
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnProcess]:
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "settings.toml").write_text(_ENDLESS)
    with own_process(folder / "data", "--config", str(folder / "settings.toml")) as running:
        yield running


def _fuzzing(share: float) -> Any:
    return settings(
        max_examples=max(1, int(share * MESSAGES / BATCH)),
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )


@pytest.fixture
def untouched(server: OwnProcess) -> Iterator[None]:
    """Fail if the loop does not go on, or anything was logged as an error.

    How fast it goes on under load is a report: `drivelesson bench link` prints the loop's rate.
    """
    yield
    said = [line for line in server.errors if " ERROR " in line or "Traceback" in line]
    assert said == []
    before = _turns(server)
    while _turns(server) < before + 10:  # the test's own limit of time ends a loop that stands
        time.sleep(0.05)


def _turns(server: OwnProcess) -> float:
    return server.metric("loop_turns_total")


@pytest.mark.slow
@pytest.mark.timeout(240)
@pytest.mark.filterwarnings("ignore::hypothesis.errors.HypothesisWarning")
def test_words(server: OwnProcess, untouched: None) -> None:
    with connect(f"ws://127.0.0.1:{server.port}/ws/drive", compression=None) as socket:
        counter = iter(range(10**9))

        @_fuzzing(0.7)
        @given(st.lists(drive_messages, min_size=BATCH, max_size=BATCH))
        def send(messages: list[str | bytes]) -> None:
            for message in messages:
                socket.send(message)
            _is_still_answered(socket, next(counter))

        send()
    assert server.metric('messages_refused_total{code="malformed"}') > MESSAGES / 10


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_acknowledgements(server: OwnProcess, untouched: None) -> None:
    with connect(f"ws://127.0.0.1:{server.port}/ws/video", compression=None) as socket:

        @_fuzzing(0.25)
        @given(st.lists(video_messages, min_size=BATCH, max_size=BATCH))
        def send(messages: list[str | bytes]) -> None:
            for message in messages:
                socket.send(message)

        send()
        frame = socket.recv(60)
        assert isinstance(frame, bytes)


@pytest.mark.slow
@pytest.mark.timeout(240)
@pytest.mark.filterwarnings("ignore")
def test_requests(server: OwnProcess, untouched: None) -> None:
    schemathesis = pytest.importorskip("schemathesis")
    from schemathesis.checks import load_all_checks, not_a_server_error

    load_all_checks()
    schema = schemathesis.openapi.from_url(server.address + "/openapi.json")
    operations = [result.ok() for result in schema.get_all_operations()]
    assert operations
    for operation in operations:

        @settings(
            max_examples=max(3, int(0.05 * MESSAGES / len(operations))),
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy())
        def send(case: Any) -> None:
            case.call_and_validate(checks=[not_a_server_error])

        send()


def _is_still_answered(socket: ClientConnection, number: int) -> None:
    socket.send(json.dumps({"type": "ping", "client_ms": number}))
    while True:
        answer = json.loads(socket.recv(60))
        if answer["type"] == "pong" and answer["client_ms"] == number:
            return
