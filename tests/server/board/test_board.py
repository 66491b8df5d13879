"""The board of a class stops every reachable robot at once, and names the others."""

from __future__ import annotations

import random
from typing import Any

import pytest

from robot.types import Action
from server.board.board import Board, BoardViewer
from server.board.class_key import ClassKey
from server.board.robot_link import START_S
from server.board.stopping import CONFIRM_S, Stopping
from server.board.teacher_session import Status
from server.board.transport import NetworkTransport

from .classroom_world import FAULTS, OPEN_FAULTS, ClassWorld, Pupil, break_down, in_class

STOP_S = 0.3


def _latched(pupil: Pupil) -> bool:
    return pupil.loop.state.emergency and pupil.driver.now is Action.STOP


def test_stop_all_reaches_ten_robots_within_300_ms() -> None:
    async def scenario(world: ClassWorld) -> float:
        pupils = list(world.pupils.values())
        await world.until_there(pupils)
        await world.drive_all(pupils)
        world.board.stop()
        return await world.until(lambda: all(map(_latched, pupils)), 5.0, "all stand")

    assert in_class(scenario, robots=10, faults=lambda dice, i: dice.choice(OPEN_FAULTS)) < STOP_S


@pytest.mark.parametrize("seed", range(5))
def test_if_some_robots_fail_the_others_stop_in_time_and_the_failed_ones_are_named(
    seed: int,
) -> None:
    """Faults before and after the robots were connected, drawn anew for each seed."""

    async def scenario(world: ClassWorld) -> None:
        before = {p.port: p.fault for p in world.pupils.values()}
        good = [p for p in world.pupils.values() if p.fault in OPEN_FAULTS]
        await world.until_there(good)
        for pupil in good[::2]:
            break_down(pupil, world.dice.choice(("gone", "silent")))
        reached = [p for p in good if p.fault in OPEN_FAULTS]
        lost = [p for p in world.pupils.values() if p not in reached]
        await world.clock.pause(world.dice.uniform(0, 8))
        world.board.stop()
        took_s = await world.until(lambda: all(map(_latched, reached)), 5.0, "the reached stand")
        assert took_s < STOP_S, "a robot that fails delays no other"
        named_s = await world.until(
            lambda: all(world.link(p).stop.stage is Stopping.NOT_REACHED for p in lost),
            5.0,
            str(lost),
        )
        assert named_s < 2 * STOP_S
        assert all(world.link(p).stop.stage is Stopping.STOPPED for p in reached)
        mendable = [p for p in lost if before[p.port] not in ("wrong key", "no class")]
        for pupil in mendable:
            break_down(pupil, "none")
        await world.until(lambda: all(map(_latched, mendable)), 15.0, "stopped once they are back")
        for pupil in lost:
            if pupil not in mendable:
                wanted = Status.NOT_OURS if before[pupil.port] == "wrong key" else Status.NO_CLASS
                assert world.link(pupil).status is wanted and not pupil.loop.state.emergency

    in_class(scenario, robots=6, seed=seed, faults=_any_fault)


@pytest.mark.parametrize(
    "text",
    ["[]", "[" * 100_000, f'{{"type": "pong", "client_ms": 1{"0" * 400}}}', '{"agreement": NaN}'],
)
def test_after_any_message_of_a_robot_the_board_connects_to_it_again(text: str) -> None:
    async def scenario(world: ClassWorld) -> None:
        pupils = list(world.pupils.values())
        await world.until_there(pupils)
        link = world.link(pupils[0])
        link.stop.channel._inbox.put_nowait(text)
        await world.until(lambda: link.status is Status.AWAY, 1.0, "it makes no sense")
        assert "is not valid" in link.detail
        await world.until_there(pupils)

    in_class(scenario, robots=2)


def test_the_terminal_does_not_warn_of_a_robot_that_may_still_be_starting(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def warned() -> list[str]:
        mine = [one for one in caplog.records if one.name == "server.board.robot_link"]
        return [one.getMessage() for one in mine if one.levelname == "WARNING"]

    async def scenario(world: ClassWorld) -> None:
        await world.clock.pause(START_S - 8.0)
        assert not warned()
        await world.clock.pause(16.0)
        assert len(warned()) == 1 and "status=away" in warned()[0]

    in_class(scenario, robots=1, faults=lambda dice, i: "silent")


@pytest.mark.parametrize("starts_s", [3.0, 12.0, 25.0])
def test_a_robot_that_has_started_is_there_within_a_second(starts_s: float) -> None:
    async def scenario(world: ClassWorld) -> None:
        [pupil] = world.pupils.values()
        await world.clock.pause(starts_s)
        break_down(pupil, "none")
        took_s = await world.until(lambda: world.link(pupil).status is Status.THERE, 5.0, "it is")
        assert took_s < 1.2

    in_class(scenario, robots=1, faults=lambda dice, i: "refuses")


def _any_fault(dice: random.Random, number: int) -> str:
    return "none" if number < 3 else dice.choice(FAULTS)


def test_a_robot_that_stands_already_confirms_the_next_stop_on_the_open_line() -> None:
    async def scenario(world: ClassWorld) -> None:
        pupils = list(world.pupils.values())
        await world.until_there(pupils)
        stops = [world.link(pupil).stop for pupil in pupils]

        def stages() -> set[Stopping | None]:
            return {stop.stage for stop in stops}

        for _ in range(2):
            world.board.stop()
            assert stages() == {Stopping.ASKED}
            await world.until(lambda: stages() == {Stopping.STOPPED}, CONFIRM_S, "all confirm it")
            await world.clock.pause(0.7)
        assert not any("/api/stop" in path for _, path in world.network.requests)

    in_class(scenario)


def test_a_pupils_own_stop_does_not_confirm_the_teachers() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        link = world.link(one)
        link.stop.stage = Stopping.ASKED
        link._note_state({"emergency": True, "stop_held_by": None})
        assert link.stop.stage is Stopping.ASKED, "the pupil may release it again"
        link._note_state({"emergency": True, "stop_held_by": "teacher"})
        assert link.stop.stage is Stopping.STOPPED

    in_class(scenario)


def test_a_late_state_neither_clears_nor_confirms_a_stop() -> None:
    """A separate request confirms the stop while the websocket still delivers older states."""

    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        link = world.link(one)
        hear, link._note_state = link._note_state, lambda _: None  # the line is slow
        free = {"emergency": False, "stop_held_by": None, "stop_number": one.hub.stop_number}
        world.board.stop()
        await world.until(lambda: link.stop.stage is Stopping.STOPPED, 2.0, "by a request")
        assert any("/api/stop" in path for _, path in world.network.requests)
        number = one.hub.stop_number
        held = {"emergency": True, "stop_held_by": "teacher", "stop_number": number}
        for late in (free, free, held):
            hear(late)
            assert link.stop.stage is Stopping.STOPPED, "that was before the stop"
        hear(free)
        assert link.stop.stage is None, "that was after it"
        hear(held)
        world.board.release({link.number: link.stop.id})
        world.board.stop()
        hear(held)
        assert link.stop.stage is Stopping.ASKED, "that was the stop before"
        hear(free | {"stop_number": number})
        hear(held | {"stop_number": number + 1})
        assert link.stop.stage is Stopping.STOPPED

    in_class(scenario)


def test_a_stop_released_before_a_state_reported_it_is_shown_as_released() -> None:
    async def scenario(world: ClassWorld) -> None:
        [one] = world.pupils.values()
        await world.until_there([one])
        link, told = world.link(one), list[dict[str, Any]]()
        hear, link._note_state = link._note_state, told.append  # the line is slow
        world.board.stop()
        await world.until(lambda: link.stop.stage is Stopping.STOPPED, 2.0, "by a request")
        one.loop.release_emergency()
        await world.clock.pause(0.5)
        hear(told[-1])  # the only state that arrives
        assert link.stop.stage is None
        await world.clock.pause(5.0)
        assert not one.loop.state.emergency

    in_class(scenario, robots=1)


def test_a_late_request_of_a_stop_does_not_stop_a_released_robot() -> None:
    async def scenario(world: ClassWorld) -> None:
        [one] = world.pupils.values()
        await world.until_there([one])
        link, request, told = world.link(one), world.network.request, list[dict[str, Any]]()

        async def slowly(place: Any, method: str, path: str, *rest: Any) -> Any:
            await world.clock.pause(2.0)
            return await request(place, method, path, *rest)

        world.network.request = slowly  # type: ignore[method-assign]
        hear, link._note_state = link._note_state, told.append
        world.board.stop()
        await world.until(lambda: link.stop.stage is Stopping.NOT_REACHED, 1.0, "a request is sent")
        hear(told[-1])
        assert link.stop.stage is Stopping.STOPPED
        world.board.release({link.number: link.stop.id})
        await world.clock.pause(5.0)
        assert not one.loop.state.emergency

    in_class(scenario, robots=1)


def test_a_stop_repeated_on_a_new_connection_is_not_cleared_by_earlier_states() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        link = world.link(one)
        world.board.stop()
        await world.until(lambda: link.stop.stage is Stopping.STOPPED, 1.0, "confirmed")
        await link.stop.send_again(link.stop.channel)
        link._note_state({"emergency": False, "stop_held_by": None})
        assert link.stop.stage is Stopping.STOPPED

    in_class(scenario)


def test_a_stop_without_robots_does_not_hold_up_the_news() -> None:
    async def scenario(world: ClassWorld) -> None:
        board = Board(ClassKey("k" * 40), NetworkTransport(), world.clock)
        board.stop()
        assert board.at_leisure.is_set(), "who is no robot of the class is told all the same"
        await board.close()

    in_class(scenario)


def test_one_robot_is_stopped_and_no_other() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, *others = world.pupils.values()
        await world.until_there([one, *others])
        world.board.stop(world.link(one).number)
        await world.until(lambda: _latched(one), STOP_S, "it stands")
        await world.clock.pause(3.0)
        assert not any(pupil.loop.state.emergency for pupil in others)

    in_class(scenario)


def test_a_robot_released_on_a_phone_is_shown_as_released() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        world.board.stop()
        await world.until(lambda: world.link(one).stop.stage is Stopping.STOPPED, 1.0, "confirmed")
        one.loop.release_emergency()
        await world.until(lambda: world.link(one).stop.stage is None, 1.0, "released")
        await world.clock.pause(5.0)
        assert not one.loop.state.emergency, "a stop that was confirmed is never repeated"
        for _ in range(2):
            world.board.stop()
            await world.until(lambda: world.link(one).stop.stage is Stopping.STOPPED, 0.3, "again")
            await world.clock.pause(1.0)
            assert world.link(one).stop.stage is Stopping.STOPPED

    in_class(scenario)


@pytest.mark.parametrize("seed", range(3))
def test_only_the_board_releases_what_the_board_stopped(seed: int) -> None:
    """Pupils and teacher press at random; after each step the rule about the last stop holds."""

    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        link, phone = world.link(one), await one.pilot(sees=True)
        await phone.wait_for_state()
        latched, held, refused = False, False, 0
        for _ in range(25):
            step = world.dice.choice(("pupil stops", "pupil releases", "board stops", "releases"))
            if step == "pupil stops":
                phone.send(type="stop")
                latched = True
            elif step == "pupil releases":
                phone.release()
                latched, refused = latched and held, refused + held
            elif step == "board stops":
                world.board.stop(link.number)
                latched = held = True
            else:
                world.board.release({link.number: link.stop.id})
                latched = held = False
            await world.clock.pause(1.5)
            assert one.loop.state.emergency is latched, step
            assert bool(link.state["stop_held_by"]) is held, step
        assert phone.errors() == ["stop_held"] * refused, "and the pupil is told why"

    in_class(scenario, robots=1, seed=seed)


def test_a_restarted_robot_is_joined_again() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        await world.until_there([one])
        one.restart()
        async with _running_hub(one):
            await world.until(lambda: world.link(one).name == "Anew", 20.0, "joined again")
            await world.until_there([one])

    in_class(scenario, robots=2)


class _running_hub:  # noqa: N801
    def __init__(self, pupil: Pupil) -> None:
        self._hub = pupil.services.hub
        pupil.hub = self._hub

    async def __aenter__(self) -> None:
        await self._hub.start()

    async def __aexit__(self, *error: object) -> None:
        await self._hub.stop()


def test_pictures_come_only_while_somebody_looks_and_about_one_a_second() -> None:
    async def scenario(world: ClassWorld) -> None:
        one, two, *_ = world.pupils.values()
        await world.until_there([one, two])
        page = BoardViewer()
        world.board.join(page)
        await world.clock.pause(2.0)
        assert not page.pictures and one.hub.video.frames_sent == 0
        world.board.watch(page, [world.link(one).number])
        await world.clock.pause(10.0)
        assert 9 <= one.hub.video.frames_sent <= 12 and two.hub.video.frames_sent == 0
        assert set(page.pictures) == {world.link(one).number}
        world.board.watch(page, [])
        await world.clock.pause(0.5)
        sent = one.hub.video.frames_sent
        await world.clock.pause(10.0)
        assert one.hub.video.frames_sent == sent and one.hub.video.viewers == 0
        world.board.leave(page)

    in_class(scenario)


def test_pictures_and_news_wait_while_a_stop_is_under_way() -> None:
    """One robot has fallen silent, so the stop stays in progress for as long as possible."""

    async def scenario(world: ClassWorld) -> None:
        one, lost, *_ = world.pupils.values()
        await world.until_there([one, lost])
        page = BoardViewer()
        world.board.join(page)
        world.board.watch(page, [world.link(one).number])
        await world.clock.pause(5.0)
        break_down(lost, "silent")
        world.board.stop()
        assert not world.board.at_leisure.is_set()
        page.pictures.clear()
        sent = one.hub.video.frames_sent
        await world.until(lambda: _latched(one), STOP_S, "it stands")
        await world.clock.pause(CONFIRM_S - 0.1)
        assert one.hub.video.frames_sent <= sent + 1, "the last one was under way"
        await world.until(world.board.at_leisure.is_set, CONFIRM_S, "it is told who is lost")
        assert world.link(lost).stop.stage is Stopping.NOT_REACHED
        await world.until(lambda: bool(page.pictures), 3.0, "pictures come again")
        world.board.leave(page)

    in_class(scenario)


def test_the_board_takes_no_wheel() -> None:
    async def scenario(world: ClassWorld) -> None:
        await world.until_there(list(world.pupils.values()))
        assert all(pupil.hub.lease.owner is None for pupil in world.pupils.values())

    in_class(scenario)


def test_an_impostor_in_between_gets_no_session_and_its_messages_do_not_count() -> None:
    """An impostor at another address relays everything to a real robot, and back."""

    async def scenario(world: ClassWorld) -> None:
        one, *_ = world.pupils.values()
        world.network.sees_as[one.port] = "10.0.0.66:8000"
        link = world.link(one)
        await world.clock.pause(10.0)
        assert link.status is Status.NOT_OURS and not link.state
        joins = [path for port, path in world.network.requests if port == one.port]
        assert "POST /api/class/join" not in joins, "the board proves nothing to it"

    async def relayed_from_the_start(world: ClassWorld) -> None:
        await scenario(world)

    in_class(relayed_from_the_start)
