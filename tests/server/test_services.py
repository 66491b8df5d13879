"""The parts of a server are made once, and found in one place."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import pytest

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver
from server.config import Config
from server.events import EventBus
from server.services import Services, make_services

SERVER = Path(__file__).parents[2] / "server"


def make() -> Services:
    clock = RealClock()
    rig = Rig(FakeDriver(), FakeCamera(clock), make_policy("published-8"), clock)
    return make_services(Config(port=0), rig)


def test_the_services_are_frozen() -> None:
    services: Any = make()
    with pytest.raises(dataclasses.FrozenInstanceError):
        services.persistence = None


def test_only_one_place_reads_the_applications_state() -> None:
    readers = {
        file.relative_to(SERVER).as_posix()
        for file in SERVER.rglob("*.py")
        if re.search(r"app\.state\.", file.read_text())
    }
    assert readers == {"app.py", "services.py"}


def test_an_event_reaches_who_listens_and_a_lasting_one_who_comes_later() -> None:
    events, heard = EventBus(), []  # type: ignore[var-annotated]
    events.publish("nobody_listens")
    events.listener = lambda name, fields: heard.append((name, fields))
    events.publish("model_saved", model="kitchen")
    events.publish("nothing_kept", detail="full")
    assert heard == [("model_saved", {"model": "kitchen"}), ("nothing_kept", {"detail": "full"})]
    assert events.lasting == (heard[1],)
