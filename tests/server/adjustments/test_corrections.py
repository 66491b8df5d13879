"""Corrections of body and camera are set on the page, saved with the robot, and recorded."""

import json
from typing import Any

import httpx
import pytest

from robot.adjustments.corrections import BodyCorrection, CameraCorrection, Corrections
from robot.devices.rig import build_rig
from robot.errors import ConfigurationError
from robot.recordings.messages import RUN
from robot.recordings.reader import read_metadata
from robot.types import Action, Mode
from server.adjustments.file import CorrectionsFile
from tests.server.virtual_server import VirtualServer


@pytest.fixture
def kept(tmp_path):
    with VirtualServer(data=tmp_path) as running:
        yield running


def put(server: VirtualServer, words: Any = None, **changes: Any) -> httpx.Response:
    return httpx.put(f"{server.address}/api/corrections", json=changes if words is None else words)


def test_a_correction_is_reported_saved_and_applied(kept, tmp_path):
    camera = kept.rig.camera
    kept.wait_until(lambda: camera.latest() is not None)
    frame = camera.latest()
    url = f"{kept.address}/api/corrections"
    nothing = {**Corrections().described()}
    possible = ["swap_sides", "turn_picture", "mirror_picture"]
    assert httpx.get(url).json() == {**nothing, "possible": possible}
    answer = put(kept, turn_picture=90, swap_sides=True).json()
    wanted = {**nothing, "turn_picture": 90, "swap_sides": True}
    assert answer == {**wanted, "possible": possible, "kept": True}
    kept.wait_until(lambda: getattr(camera.latest(), "width", 0) == frame.height)
    assert put(kept, mirror_picture=True).json()["turn_picture"] == 90, "the other corrections stay"
    again = build_rig("sim", learner="default-8")
    again.driver, again.camera = kept.rig.driver, camera
    assert CorrectionsFile(tmp_path, again, {})._wanted == Corrections.of(kept.rig)
    other = CorrectionsFile(tmp_path, build_rig("sim", learner="default-8"), {})
    assert other._wanted == Corrections(), "another body and camera have corrections of their own"


def test_a_robot_that_drives_is_stopped_first(kept):
    with kept.pilot() as pilot:
        pilot.mode("train")
        pilot.hold("left")
        kept.wait_until(lambda: kept.driver.now is Action.LEFT)
        assert put(kept, swap_sides=True).is_success
        kept.wait_until(lambda: kept.driver.now is Action.STOP)
        assert kept.rig.loop.mode is Mode.STOPPED
        pilot.mode("train")
        kept.wait_until(lambda: kept.driver.now is Action.RIGHT)
        assert kept.rig.loop.state.decision.action is Action.LEFT, "only the driver swaps the sides"


def test_a_correction_that_does_not_apply_is_refused_and_changes_nothing(kept):
    for words, status in (
        ({"trim": 0.1}, 409),
        ({"reverse": "left"}, 409),
        ({"turn_picture": 180, "trim": 0.1}, 409),
        ({"trim": 0.5}, 400),
        ({"turn_picture": 45}, 400),
        ({"swap_sides": "yes"}, 400),
        ({"reverse": "up"}, 400),
        ([], 400),
    ):
        assert put(kept, words).status_code == status, words
        assert Corrections.of(kept.rig) == Corrections(), words


def test_each_recording_says_how_its_robot_was_corrected(tmp_path):
    """A change of the corrections ends the recording in progress."""
    with VirtualServer(data=tmp_path) as server:
        for turn in (0, 180):
            assert put(server, turn_picture=turn).json()["kept"]
            with server.pilot() as pilot:
                pilot.mode("train")
                pilot.hold("left")
                taught = server.rig.loop.history.taught
                wanted = sum(taught.values()) + 3
                server.wait_until(lambda t=taught, n=wanted: sum(t.values()) >= n)
        assert put(server, turn_picture=90).json()["kept"]
    found = (tmp_path / "episodes").glob("*.mcap")
    told = [json.loads(read_metadata(path)[RUN]["options"]) for path in found]
    assert sorted(options["turn_picture"] for options in told) == ["0", "180"]


@pytest.mark.parametrize(
    "damage",
    [
        *(b"", b"{", b"[]", b"\xff", b'{"robots": 3}', b'{"robots": {"sim": {"trim": "x"}}}'),
        *(b'{"cameras": {"sim": {"turn_picture": 45}}}', b'{"robots": {"sim": [1]}, "x": {}}'),
    ],
)
def test_a_damaged_file_counts_as_none(tmp_path, damage):
    (tmp_path / "corrections.json").write_bytes(damage)
    rig = build_rig("sim", learner="default-8")
    file = CorrectionsFile(tmp_path, rig, {})
    assert file._wanted == Corrections()
    rig.driver.correct(BodyCorrection(trim=0.1))
    assert file.save()
    assert CorrectionsFile(tmp_path, rig, {})._wanted.body.trim == 0.1


def test_options_override_saved_corrections_and_are_saved(kept, tmp_path):
    for given, is_swapped, turn in (
        ({"swap_sides": "yes", "turn_picture": "90"}, True, 90),
        ({}, True, 90),
        ({"swap_sides": "no", "turn_picture": "180"}, False, 180),
    ):
        CorrectionsFile(tmp_path, kept.rig, given).apply()
        assert Corrections.of(kept.rig) == Corrections(
            body=BodyCorrection(swap_sides=is_swapped), camera=CameraCorrection(turn_deg=turn)
        )
    for given in ({"trim": "9"}, {"turn_picture": "45"}, {"swap_sides": "perhaps"}):
        with pytest.raises(ConfigurationError):
            CorrectionsFile(tmp_path, kept.rig, given)


def test_an_option_that_does_not_apply_is_refused_unless_it_was_saved_earlier(kept, tmp_path):
    saved = {"robots": {"fake": {"reverse": "left", "swap_sides": True}}}
    (tmp_path / "corrections.json").write_text(json.dumps(saved))
    CorrectionsFile(tmp_path, kept.rig, {}).apply()
    assert Corrections.of(kept.rig).body == BodyCorrection(swap_sides=True)
    with pytest.raises(ConfigurationError, match="reverse"):
        CorrectionsFile(None, kept.rig, {"reverse": "left"}).apply()
