"""Simulated robots of a class in one process, each with a server of its own and a pupil who drives.

`python -m server.lab.bench.classroom COUNT RATE KEYFILE` prints the ports. A line on standard
input is a command: `drive` starts all robots that stand, with Forward held on each; `report` says
when each stopped.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

from robot.devices.rig import Rig, build_rig
from robot.types import Action, Mode, PilotCommand
from server.app import create_app
from server.board.class_key import read_class_key
from server.board.classroom import Classroom
from server.config import Config
from server.hosting.serving import served
from server.lab.bench.process import answer_all
from server.services import make_services

_BEAT_S = 0.1


class _Pupil:
    """One robot and the finger on its pad; notes when its wheels were last told to turn."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.moved_s: float | None = None
        self.latched_s: float | None = None
        self._seq = 0
        send = rig.driver.send_action

        def noting(action: Action, *, speed_scale: float = 1.0) -> Action:
            sent = send(action, speed_scale=speed_scale)
            if sent is not Action.STOP:
                self.moved_s = time.monotonic()
            return sent

        rig.driver.send_action = noting  # type: ignore[method-assign]
        rig.loop.subscribe(self._note)

    def _note(self, _: object) -> None:
        if self.rig.loop.state.emergency and self.latched_s is None:
            self.latched_s = time.monotonic()

    def start_if_stopped(self) -> None:
        if self.rig.loop.state.decision.mode is Mode.TRAIN and self.latched_s is None:
            return
        self.rig.loop.release_emergency()
        now_s = self.rig.clock.now_s()
        self.rig.loop.set_mode(
            Mode.TRAIN, proven_s=now_s, frame_id=self.rig.loop.state.frame_id
        ).result(5)
        self.latched_s = self.moved_s = None

    def hold(self) -> None:
        """Send what a phone sends ten times a second."""
        self._seq += 1
        now_s = self.rig.clock.now_s()
        self.rig.loop.command(
            PilotCommand(
                held=Action.FORWARD if self._seq % 40 < 20 else Action.LEFT,
                frame_id=self.rig.loop.state.frame_id,
                seq=self._seq,
                received_s=now_s,
                pilot="bench",
                frame_age_s=0.02,
                phone_s=0.01,
                proven_s=now_s,
            )
        )


def main() -> None:
    count, rate_hz, key = int(sys.argv[1]), float(sys.argv[2]), read_class_key(Path(sys.argv[3]))
    options: dict[str, Any] = {"frame_rate_hz": str(rate_hz)}
    with contextlib.ExitStack() as stack:
        pupils, ports = [], []
        for i in range(count):
            rig = stack.enter_context(build_rig("sim", options={**options, "seed": str(i + 1)}))
            config = Config(port=0)
            services = make_services(
                config,
                rig,
                name=f"Sim {os.getpid() % 1000}-{i + 1}",
                options={"classroom": Classroom(key)},
            )
            address = stack.enter_context(served(create_app(services), config))
            ports.append(int(address.rsplit(":", 1)[1]))
            pupils.append(_Pupil(rig))

        def hold_all() -> None:
            while True:
                time.sleep(_BEAT_S)
                for pupil in pupils:
                    pupil.hold()

        threading.Thread(target=hold_all, name="pupils", daemon=True).start()
        answer_all(ports, lambda word: _answer(word, pupils))


def _answer(word: str, pupils: list[_Pupil]) -> list[dict[str, Any]]:
    if word == "drive":
        for pupil in pupils:
            pupil.start_if_stopped()
    return [
        {
            "moved_s": pupil.moved_s,
            "latched_s": pupil.latched_s,
            "rate_hz": pupil.rig.loop.state.cycle_hz,
        }
        for pupil in pupils
    ]


if __name__ == "__main__":
    main()
