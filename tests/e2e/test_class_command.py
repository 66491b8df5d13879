"""`drivelesson class` as a teacher starts it, from the code on paper to Ctrl-C.

tests/server tests which data the class keeps for the next day.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from server.board.class_orders import give_order
from tests.kit.sizes import size
from tests.soak.classroom import Class, descendants

ROBOTS = size("ROBOTS", 2, 10)


@pytest.mark.timeout(900)
def test_a_class_works_from_the_code_on_paper_to_ctrl_c(tmp_path: Path) -> None:
    with Class(tmp_path, ROBOTS) as running:
        for field in ("name", "colour", "address"):
            told = {robot[field] for robot in running.robots}
            assert len(told) == ROBOTS
        pupils = running.pupils()
        for pupil in pupils:
            pupil.drive_until(lambda pupil=pupil: pupil.state["lessons"] >= 10)
            pupil.drive_until(lambda pupil=pupil: pupil.state["lessons"] >= 20, "left")
            pupil.hold(None)
            pupil.mode("autonomous")
        running.stop_all()
        for order, did in {"hand-over": "is ready for the next class", "undo": "as it was"}.items():
            is_done, lines = give_order(order, running.port)
            assert is_done and "".join(lines).count(did) == ROBOTS, lines
        for pupil in pupils:
            pupil.close()
        processes = descendants(running.process.pid)
        assert len(processes) >= ROBOTS
    assert not [pid for pid in processes if Path(f"/proc/{pid}").exists()], "a process is left"
