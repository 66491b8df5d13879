"""No recording contains a secret."""

from __future__ import annotations

import argparse
from types import SimpleNamespace
from typing import Any

import pytest

from robot.devices.options import options_of
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from server.cli.serve import _recorded
from tests.own_plugins import own_plugins

SECRET = "http://user:hunter2@camera/stream"


def kinds() -> list[Any]:
    cameras = [load_camera(name) for name in own_plugins(CAMERAS)]
    return [*cameras, *(load_driver(name) for name in own_plugins(DRIVERS))]


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: str(kind.name))
def test_a_secret_is_not_recorded(kind: Any) -> None:
    options = options_of(kind.options_type)
    args = argparse.Namespace(port=8000, **{one.name: SECRET for one in options})
    rig: Any = SimpleNamespace(driver=object.__new__(kind), camera=object.__new__(kind))
    recorded = _recorded(args, rig)
    assert set(recorded) == {"port", *(one.name for one in options if not one.is_secret)}


def test_these_options_are_secret() -> None:
    options = [one for kind in kinds() for one in options_of(kind.options_type)]
    secrets = {"source", "secret", "brick_secret"} & {one.name for one in options}
    assert {one.name for one in options if one.is_secret} == secrets
