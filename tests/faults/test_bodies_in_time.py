"""Each body stands within half a second of losing its server, with any messages in transit."""

from __future__ import annotations

import pytest

from tests.kit.sizes import crossed

from .bodies import BODIES, DRIVES, FAULTS, STANDS_S, stood_after_s
from .table import SEEDS

N_DRIVES = min(max(SEEDS // 5, 3), DRIVES)


@pytest.mark.parametrize("proportional", [False, True], ids=["by moves", "proportional"])
@crossed(fault=FAULTS, name=BODIES)
def test_each_body_stops_in_time_when_its_server_is_gone(
    name: str, fault: str, proportional: bool
) -> None:
    if name == "gpio":
        pytest.importorskip("gpiozero", reason="an extra, and not of Debian 12's versions")
    late = {
        seed: stood
        for seed in range(N_DRIVES)
        if (stood := stood_after_s(name, fault, seed, proportional=proportional)) >= STANDS_S
    }
    assert not late, f"moves on, by seed: {late}"
