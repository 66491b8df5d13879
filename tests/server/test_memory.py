"""Whatever strangers send, the memory of the server stays small; measured in its own process."""

from __future__ import annotations

import itertools
from pathlib import Path

import httpx
import pytest

from tests.robot.models.test_checking import malformed

from .own_process import own_process
from .test_hostile_values import BODIES, PATHS, VALUES

MOST_MB = 300
pytestmark = [pytest.mark.realtime, pytest.mark.slow]


def peak_mb(pid: int) -> float:
    """Return the most memory that a process ever had, in MB."""
    return int(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0]) / 1024


def test_hostile_values_and_malformed_models_leave_memory_small(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers: list[int] = []
    with own_process(tmp_path) as server, httpx.Client(base_url=server.address, timeout=60) as page:
        begun_mb = peak_mb(server.process.pid)
        for learner in ("published-4", "default-6"):
            for what, data in itertools.islice(malformed(learner), 0, None, 15):
                answers.append(page.put("/api/models/x/file", content=data).status_code)
                assert answers[-1] == 422, what
        answers.append(page.put("/api/models/x/file", content=bytes(40_000_000)).status_code)
        for (method, path, field), value in itertools.product(BODIES, VALUES):
            body = f'{{"{field}": {value}}}'.encode()
            answers.append(page.request(method, path, content=body).status_code)
        for method, path in PATHS:
            answers.append(page.request(method, path.replace("NAME", "x" * 3_000)).status_code)
        most_mb = peak_mb(server.process.pid)
        assert page.get("/healthz").status_code == 200
    with capsys.disabled():
        print(f"\n{len(answers)} hostile requests: {begun_mb:.0f} MB, at most {most_mb:.0f} MB")
    assert len(answers) > 300 and max(answers) < 500
    assert most_mb < MOST_MB
