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
from server.services import Services, make_services

from .virtual_server import VirtualServer

SERVER = Path(__file__).parents[2] / "server"


def make() -> Services:
    clock = RealClock()
    rig = Rig(FakeDriver(), FakeCamera(clock), make_policy("published-8"), clock)
    return make_services(Config(port=0), rig)


def test_the_services_are_frozen() -> None:
    services: Any = make()
    with pytest.raises(dataclasses.FrozenInstanceError):
        services.persistence = None


def test_only_one_place_reads_the_applications_services() -> None:
    readers = {
        file.relative_to(SERVER).as_posix()
        for file in SERVER.rglob("*.py")
        if re.search(r"app\.state\.services", file.read_text())
    }
    assert readers == {"app.py", "services.py"}


def test_an_event_reaches_present_clients_and_a_lasting_event_also_later_ones() -> None:
    make().hub.announce("nobody_listens")  # before the start
    with VirtualServer() as server:
        with server.pilot() as first:
            server.hub.announce("model_saved", model="kitchen")
            server.hub.announce("nothing_kept", detail="full")
            first.wait_for(lambda m: m.get("name") == "model_saved" and m["model"] == "kitchen")
            first.wait_for(lambda m: m.get("name") == "nothing_kept")
        with server.pilot() as second:
            second.wait_for(lambda m: m.get("name") == "nothing_kept" and m["detail"] == "full")
            assert not any(m.get("name") == "model_saved" for m in second.page.messages)
