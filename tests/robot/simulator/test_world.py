"""Built-in worlds and a user's own worlds are read from files, and broken ones are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.simulator import world
from robot.simulator.world import load_world, tinted, world_names

BOX = (Path(world.__file__).parent / "worlds" / "box.toml").read_text("utf-8")


def test_the_worlds_of_the_paper_are_there() -> None:
    assert {"box", "office", "corridor"} <= set(world_names())
    assert (load_world("box").width_m, load_world("box").depth_m) == (1.15, 1.15)
    office = load_world("office")
    assert office.width_m * office.depth_m == pytest.approx(8.7, abs=0.05)
    assert {o.name for o in office.obstacles} == {"trash can", "backpack", "violin case"}


def test_a_world_that_was_written_on_windows_is_a_world(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(BOX, encoding="utf-8-sig", newline="\r\n")
    assert load_world(str(path)).start == load_world("box").start


BROKEN = {
    "room": ("room = 3", "mine.toml"),
    "start": ("[room]\nwidth_m = 1", "'start' is missing"),
    "words": ("not toml", "mine.toml"),
    "nested": ("room = " + "[" * 20_000, "mine.toml"),
    "outside": (BOX.replace("x_m = 0.45", "x_m = 4.5"), "outside the room"),
}


@pytest.mark.parametrize(("text", "complaint"), BROKEN.values(), ids=BROKEN)
def test_a_broken_or_unknown_world_is_one_clear_error(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=complaint) as caught:
        load_world(str(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(ConfigurationError, match=r"unknown world 'moon'.*box.*office"):
        load_world("moon")


def test_painted_rooms_can_be_told_apart_and_are_the_same_rooms() -> None:
    room = load_world("box")
    rooms = [tinted(room, 137.508 * i) for i in range(60)]
    assert len({one.wall_colours for one in rooms}) == 60
    for one in rooms:
        assert one.floor_colours == room.floor_colours and one.start == room.start
        assert all(0 <= part <= 255 for wall in one.wall_colours for part in wall)
