"""A robot with a new address keeps its card, and STOP reaches every address of the robot."""

import itertools
from functools import partial

from robot.types import Action
from server.board.board import BoardViewer
from server.board.stopping import Stopping
from server.board.teacher_session import Status
from server.board.transport import RobotAddress

from .classroom_world import ClassWorld, Pupil, break_down, in_class_time, latched


def same_robot(world: ClassWorld) -> list[Pupil]:
    """Give all robots the id of the first robot; the board knows only the first robot's address."""
    pupils = list(world.pupils.values())
    for pupil in pupils[1:]:
        pupil.classroom.id = pupils[0].classroom.id
        pupil.fault = "gone"
    world.board.add(RobotAddress("127.0.0.1", pupils[0].port))
    return pupils


async def comes_up(world: ClassWorld, pupil: Pupil) -> None:
    break_down(pupil, "none")
    world.board.announce(RobotAddress("127.0.0.1", pupil.port))
    await world.until(lambda: find(world, pupil) is not None, 5.0, "the robot has proved the key")
    await world.until_there([pupil])


def find(world: ClassWorld, pupil: Pupil):
    links = [r for r in world.board.robots.values() if r.address.port == pupil.port]
    return links[0] if links else None


def cards(world: ClassWorld) -> dict[int, int]:
    """Return the port of each card's robot, by the card's number."""
    shown = world.board.shown()
    return {robot.number: robot.address.port for robot in shown}


@in_class_time(robots=3, is_told=False)
async def test_a_robot_that_moves_keeps_its_card_and_its_stop_and_no_stop_waits_for_its_old_address(
    world,
):
    first, *others = same_robot(world)
    await world.until_there([first])
    page = BoardViewer()
    world.board.join(page)
    for old, new in itertools.pairwise([first, *others]):
        break_down(old, "gone")
        left, came = world.link(old), partial(find, world, new)
        await world.until(lambda left=left: left.status is Status.AWAY, 5.0, "the robot is lost")
        world.board.stop()
        await world.until(lambda left=left: left.stop.stage is Stopping.NOT_REACHED, 1.0)
        await world.drive_all([new])
        page.changed.clear()
        await comes_up(world, new)
        await world.until(partial(latched, new), 1.0, "the stop follows the robot")
        assert cards(world) == {1: new.port}
        assert page.changed >= {1, left.number}, "the page draws both cards again"
        await world.until(lambda came=came: came().stop.stage is Stopping.STOPPED, 1.0)
        world.board.release({1: came().stop.id})
        await world.until(lambda new=new: not new.loop.state.emergency, 1.0, "the stop is released")
        new.restart()
        await new.hub.start()
        await world.until(lambda came=came: came().name == "Anew", 20.0)
        await world.clock.pause(5.0)
        assert not new.loop.state.emergency, "a released stop is not sent again"


@in_class_time(robots=2, is_told=False)
async def test_two_robots_with_the_same_id_have_two_cards_and_both_are_stopped(world):
    one, copy = same_robot(world)
    await world.until_there([one])
    await comes_up(world, copy)
    await world.drive_all([one, copy])
    world.board.stop()
    await world.until(lambda: latched(one) and latched(copy), 0.3, "both robots stand")
    break_down(copy, "silent")
    await world.until(lambda: world.link(copy).status is Status.AWAY, 5.0, "the robot is lost")
    assert cards(world) == {1: one.port, 2: copy.port}
    world.board.stop()
    await world.until(
        lambda: world.link(copy).stop.stage is Stopping.NOT_REACHED, 1.0, "the copy is named"
    )


@in_class_time(robots=2, is_told=False)
async def test_a_robot_that_was_taken_for_moved_is_stopped_and_shown_when_it_answers(world):
    """An SD card was copied; the board sees the second robot only while it misses the first."""
    one, copy = same_robot(world)
    await world.until_there([one])
    await world.drive_all([one])
    one.fault = "gone"  # only its pupil's phone reaches it, not the board
    world.link(one).stop.channel.socket.cut()
    await world.until(lambda: world.link(one).status is Status.AWAY, 5.0, "the robot is lost")
    await comes_up(world, copy)
    assert cards(world) == {1: copy.port}
    world.board.stop(1)
    await world.until(lambda: latched(copy), 0.3, "the copy stands")
    await world.until(world.board.at_leisure.is_set, 0.1, "the stop does not wait for the other")
    assert one.driver.now is Action.FORWARD
    one.fault = "none"
    await world.until(lambda: latched(one), 5.0, "the robot stops when it answers")
    await world.until_there([one])
    await world.clock.pause(1.0)
    assert cards(world) == {1: copy.port, 2: one.port}
