"""The board of a class stops all reachable robots at once, and names the other robots.

test_unverified_robots.py shows that STOP reaches ten robots in time among a thousand others.
"""

import random
from typing import Any

import pytest

from server.board.board import OWN_ADDRESS_EVERY_S, BoardViewer
from server.board.robot_link import _INVITE_EVERY_S, START_S
from server.board.stopping import CONFIRM_S, Stopping
from server.board.teacher_session import Status

from .classroom_world import (
    FAULTS,
    OPEN_FAULTS,
    PATIENCE_S,
    STOP_S,
    break_down,
    in_class_time,
    latched,
)


def _any_fault(dice: random.Random, number: int) -> str:
    return "none" if number < 3 else dice.choice(FAULTS)


@pytest.mark.parametrize("seed", range(5))
@in_class_time(robots=6, faults=_any_fault)
async def test_if_some_robots_fail_the_others_stop_in_time_and_the_failed_ones_are_named(
    world, seed
):
    """The seed determines each robot's fault, before or after it was connected."""
    before = {p.port: p.fault for p in world.pupils.values()}
    good = [p for p in world.pupils.values() if p.fault in OPEN_FAULTS]
    await world.until_there(good)
    for pupil in good[::2]:
        break_down(pupil, world.dice.choice(("gone", "silent")))
    reached = [p for p in good if p.fault in OPEN_FAULTS]
    lost = [p for p in world.pupils.values() if p not in reached]
    await world.clock.pause(world.dice.uniform(0, 8))
    world.board.stop()
    took_s = await world.until(lambda: all(map(latched, reached)), 5.0, "these robots stand")
    assert took_s < STOP_S, "a robot that fails does not delay the others"
    named_s = await world.until(
        lambda: {world.link(p).stop.stage for p in lost} == {Stopping.NOT_REACHED}, 5.0, str(lost)
    )
    assert named_s < 2 * STOP_S
    assert all(world.link(p).stop.stage is Stopping.STOPPED for p in reached)
    mendable = [p for p in lost if before[p.port] not in ("wrong key", "no class")]
    await world.clock.pause(12.0)  # during a stop, the board retries often
    for pupil in mendable:
        break_down(pupil, "none")
    await world.until(lambda: all(map(latched, mendable)), PATIENCE_S + 0.5, "the robots are back")
    for pupil in lost:
        if pupil not in mendable:
            wanted = Status.NOT_OURS if before[pupil.port] == "wrong key" else Status.NO_CLASS
            assert world.link(pupil).status is wanted and not pupil.loop.state.emergency


@pytest.mark.parametrize(
    "text",
    ["[]", "[" * 100_000, f'{{"type": "pong", "client_ms": 1{"0" * 400}}}', '{"agreement": NaN}'],
)
@in_class_time(robots=1)
async def test_after_any_message_of_a_robot_the_board_connects_to_it_again(world, text):
    _, link = await world.first()
    link.stop.channel._inbox.put_nowait(text)
    await world.until(lambda: link.status is Status.AWAY, 1.0, "the board drops the robot")
    assert "is not valid" in link.detail
    await world.until_there()


@pytest.mark.parametrize(("starts_s", "n_warnings"), [(3.0, 0), (START_S - 8.0, 0), (45.0, 1)])
@in_class_time(robots=1, faults=lambda dice, i: "refuses")
async def test_a_robot_may_take_long_to_start_and_is_there_soon_afterwards(
    world, starts_s, n_warnings, caplog
):
    [pupil] = world.pupils.values()
    await world.clock.pause(starts_s)
    said = [one.name for one in caplog.records if one.levelname == "WARNING"]
    assert said.count("server.board.robot_link") == n_warnings
    break_down(pupil, "none")
    took_s = await world.until(lambda: world.link(pupil).status is Status.THERE, 10.0, "it is back")
    assert took_s < (1.2 if starts_s < START_S else 5.2)


@in_class_time()
async def test_a_robot_that_stands_already_confirms_the_next_stop_on_the_open_line(world):
    await world.until_there()

    def stages():
        return {link.stop.stage for link in world.board.robots.values()}

    for _ in range(2):
        world.board.stop()
        assert stages() == {Stopping.ASKED}
        await world.until(lambda: stages() == {Stopping.STOPPED}, CONFIRM_S, "all confirm")
        await world.clock.pause(0.7)
    assert not any("/api/stop" in path for _, path in world.network.requests)
    assert world.board.at_leisure.is_set(), "updates arrive again"
    assert all(pupil.hub.lease.owner is None for pupil in world.pupils.values())


@in_class_time(robots=1)
async def test_only_a_state_that_is_newer_than_a_stop_confirms_or_clears_it(world):
    """A separate request confirms the stop while the websocket still delivers older states."""
    one, link = await world.first()
    hear, link._note_state = link._note_state, lambda _: None  # the websocket is slow
    free = {"emergency": False, "stop_held_by": None, "stop_number": one.hub.emergency.number}
    world.board.stop()
    hear({"emergency": True, "stop_held_by": None})
    assert link.stop.stage is Stopping.ASKED, "this STOP is the pupil's own"
    await world.until(lambda: link.stop.stage is Stopping.STOPPED, 2.0, "the request stops it")
    assert any("/api/stop" in path for _, path in world.network.requests)
    number = one.hub.emergency.number
    held = {"emergency": True, "stop_held_by": "teacher", "stop_number": number}
    for late in (free, free, held):
        hear(late)
        assert link.stop.stage is Stopping.STOPPED, "this state is from before the stop"
    hear(free)
    assert link.stop.stage is None, "this state is from after the stop"
    hear(held)
    world.board.release({link.number: link.stop.id})
    world.board.stop()
    hear(held)
    assert link.stop.stage is Stopping.ASKED, "this state belongs to the earlier stop"
    hear(free | {"stop_number": number})
    hear(held | {"stop_number": number + 1})
    assert link.stop.stage is Stopping.STOPPED
    await link.stop.send_again(link.stop.channel)  # the stop is sent on a new connection
    hear({"emergency": False, "stop_held_by": None})
    assert link.stop.stage is Stopping.STOPPED, "this state came on the earlier connection"


@in_class_time(robots=1)
async def test_a_stop_released_before_a_state_reported_it_is_shown_as_released(world):
    one, link = await world.first()
    told = list[dict[str, Any]]()
    hear, link._note_state = link._note_state, told.append  # the websocket is slow
    world.board.stop()
    await world.until(lambda: link.stop.stage is Stopping.STOPPED, 2.0, "the request stops it")
    one.loop.release_emergency()
    await world.clock.pause(0.5)
    hear(told[-1])  # the only state that arrives
    assert link.stop.stage is None
    await world.clock.pause(5.0)
    assert not one.loop.state.emergency


@in_class_time(robots=1)
async def test_a_late_request_of_a_stop_does_not_stop_a_released_robot(world):
    one, link = await world.first()
    request, told = world.network.request, list[dict[str, Any]]()

    async def slowly(place, method, path, *rest):
        await world.clock.pause(2.0)
        return await request(place, method, path, *rest)

    world.network.request = slowly
    hear, link._note_state = link._note_state, told.append
    world.board.stop()
    await world.until(lambda: link.stop.stage is Stopping.NOT_REACHED, 1.0, "a request is sent")
    hear(told[-1])
    assert link.stop.stage is Stopping.STOPPED
    world.board.release({link.number: link.stop.id})
    await world.clock.pause(5.0)
    assert not one.loop.state.emergency


@in_class_time()
async def test_one_robot_is_stopped_and_no_other_and_shown_as_free_when_a_phone_releases_it(world):
    one, link = await world.first()
    world.board.stop(link.number)
    await world.until(lambda: latched(one), STOP_S, "the robot stands")
    await world.until(lambda: link.stop.stage is Stopping.STOPPED, 1.0, "the stop is confirmed")
    await world.clock.pause(3.0)
    assert [p for p in world.pupils.values() if p.loop.state.emergency] == [one]
    one.loop.release_emergency()
    await world.until(lambda: link.stop.stage is None, 1.0, "the stop is released")
    await world.clock.pause(5.0)
    assert not one.loop.state.emergency, "a confirmed stop is never repeated"


@pytest.mark.parametrize("seed", range(3))
@in_class_time(robots=1)
async def test_only_the_board_releases_what_the_board_stopped(world, seed):
    """Pupils and teacher stop and release at random; after each step, the last STOP decides who may
    release it."""
    one, link = await world.first()
    phone = await one.pilot(sees=True)
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
    assert phone.errors() == ["stop_held"] * refused, "the pupil's page gets the reason"


@in_class_time(robots=2)
async def test_a_restarted_robot_is_joined_again(world):
    one, link = await world.first()
    one.restart()
    await one.hub.start()
    await world.until(lambda: link.name == "Anew", 20.0, "the board has joined again")
    await world.until_there([one])
    await one.hub.stop()


@in_class_time(robots=1)
async def test_a_robot_whose_name_leads_to_another_address_is_found_and_stopped_there(world):
    """The network gives the robot another address while its process runs."""
    one, link = await world.first()
    break_down(one, "gone")
    await world.until(lambda: link.status is Status.AWAY, 5.0, "the robot is lost")
    world.network.hosts[one.port] = "127.0.0.2"
    break_down(one, "none")
    world.board.stop()
    await world.until(lambda: latched(one), 3.0, "the robot stops")
    await world.until_there()
    assert link.describe()["address"] == f"http://127.0.0.2:{one.port}"


@pytest.mark.parametrize("fault", ["refuses", "silent", "nonsense"])
@in_class_time(robots=1)
async def test_stop_keeps_its_open_connection_while_the_robot_refuses_requests(world, fault):
    """A robot without free slots refuses new connections and requests."""
    one, link = await world.first()
    joined_s = link.joined_s
    one.fault = fault  # only new connections fail
    await world.clock.pause(2 * _INVITE_EVERY_S)
    assert link.status is Status.THERE and link.joined_s == joined_s
    world.board.stop()
    await world.until(lambda: latched(one), STOP_S, "the open connection stops it")
    one.fault, before = "none", link.invitations
    await world.until(
        lambda: link.invitations > before and link.invitation, 1.1 * _INVITE_EVERY_S, "a new code"
    )


@in_class_time(robots=1)
async def test_phones_get_the_new_address_of_this_computer_and_its_robots_stay_connected(world):
    """The teacher's laptop starts without a network, and then changes between two networks."""
    one, link = await world.first()
    joined_s, own = link.joined_s, [None]
    world.board.follow_own_address(lambda: own[-1])
    await world.until(lambda: link.page_address(), 5.0, "the code is shown")
    assert link.page_address().startswith(f"http://127.0.0.1:{one.port}/pair#")
    for host in ("10.0.0.5", "10.0.1.7"):
        own.append(host)
        await world.clock.pause(2 * OWN_ADDRESS_EVERY_S)
        assert link.joined_s == joined_s, "the connection for STOP stays the same"
        assert link.describe()["page"] == f"http://{host}:{one.port}"
        assert link.page_address().startswith(f"http://{host}:{one.port}/pair#")


@in_class_time()
async def test_pictures_come_only_while_somebody_looks_and_about_one_a_second(world):
    (_, link), page = await world.first(), BoardViewer()
    video, others = (pupil.hub.broadcast.video for pupil in [*world.pupils.values()][:2])
    world.board.join(page)
    await world.clock.pause(2.0)
    assert not page.pictures and video.frames_sent == 0
    world.board.watch(page, [link.number])
    await world.clock.pause(10.0)
    assert 9 <= video.frames_sent <= 12 and others.frames_sent == 0
    assert set(page.pictures) == {link.number}
    world.board.watch(page, [])
    await world.clock.pause(0.5)
    sent = video.frames_sent
    await world.clock.pause(10.0)
    assert video.frames_sent == sent and video.viewers == 0
    world.board.leave(page)


@in_class_time()
async def test_pictures_and_news_wait_while_a_stop_is_under_way(world):
    """One robot has fallen silent, so the stop stays in progress for as long as possible."""
    (one, link), page = await world.first(), BoardViewer()
    lost = list(world.pupils.values())[1]
    world.board.join(page)
    world.board.watch(page, [link.number])
    await world.clock.pause(5.0)
    break_down(lost, "silent")
    silent_s = world.clock.now_s()
    world.board.stop()
    assert not world.board.at_leisure.is_set()
    page.pictures.clear()
    sent = one.hub.broadcast.video.frames_sent
    await world.until(lambda: latched(one), STOP_S, "the robot stands")
    await world.clock.pause(CONFIRM_S - 0.1)
    assert one.hub.broadcast.video.frames_sent <= sent + 1, "one picture was in transit"
    await world.until(world.board.at_leisure.is_set, CONFIRM_S, "the board gives up")
    assert world.link(lost).stop.stage is Stopping.NOT_REACHED
    await world.until(lambda: bool(page.pictures), 3.0, "pictures come again")
    await world.until(lambda: world.link(lost).status is Status.AWAY, 3.0, "the robot is lost")
    assert 3.0 < world.clock.now_s() - silent_s < 4.1, "the next ping notices the silence"
    world.board.leave(page)


@in_class_time()
async def test_an_impostor_in_between_gets_no_session_and_its_messages_do_not_count(world):
    """An impostor at another address relays everything between board and robot."""
    one, *_ = world.pupils.values()
    world.network.sees_as[one.port] = "10.0.0.66:8000"
    link = world.link(one)
    await world.clock.pause(10.0)
    assert link.status is Status.NOT_OURS and not link.state
    joins = [path for port, path in world.network.requests if port == one.port]
    assert "POST /api/class/join" not in joins, "the board sends this robot no proof"
