"""Each body stops within half a second after it lost its server, with any messages in transit."""

from __future__ import annotations

import pytest

from tests.kit.sizes import crossed

from .bodies import BODIES, DRIVES, FAULTS, stood_after_s
from .table import LIMIT_S, SEEDS

N_DRIVES = min(max(SEEDS // 5, 3), DRIVES)


@crossed(fault=FAULTS, name=BODIES, by=["moves", "degrees"])
def test_each_body_stops_in_time_when_its_server_is_gone(fault: str, name: str, by: str) -> None:
    if name == "gpio":
        pytest.importorskip("gpiozero", reason="the extra gpio is not installed")
    took_s = [
        stood_after_s(name, fault, seed, proportional=by == "degrees") for seed in range(N_DRIVES)
    ]
    late = {seed: one_s for seed, one_s in enumerate(took_s) if one_s >= LIMIT_S}
    assert not late, f"these bodies do not stop in time, by seed: {late}"
