"""The agent, its callers, and the driver that uses a connection to the agent, in virtual time."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from robot.bodies.ev3.agent import callers, wire
from robot.bodies.ev3.agent import server as agent_server
from robot.bodies.ev3.driver import Ev3Driver, Ev3Options
from robot.bodies.ev3.fake_brick import POLL_S, FakeBrick
from robot.bodies.ev3.handshake import join, secret_path
from robot.bodies.ev3.link import REJOIN_S, SILENCE_S, BrickLink
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.driver import BodyButton
from robot.errors import CameraError, ConfigurationError, DriveError
from robot.testing import VirtualClock
from robot.types import Action, Mode
from tests.robot.bodies.ev3.virtual_agent import (
    ADDRESS,
    SECRET,
    Listener,
    Net,
    SimulatedCamera,
    VirtualAgent,
    connected,
)

BRICK = ("brick", 8765)


def make_driver(
    agent: VirtualAgent, secret: str = SECRET, address: str = ADDRESS, **options: str
) -> Ev3RemoteDriver:
    found = Ev3RemoteOptions(brick=address, **options)
    return Ev3RemoteDriver(found, agent.link(secret, address))


@pytest.fixture
def driver(agent: VirtualAgent, brick: FakeBrick) -> Iterator[Ev3RemoteDriver]:
    with make_driver(agent) as connected_driver:
        brick.wait_until(lambda: "t" in connected_driver.link.report)
        yield connected_driver


def sealed_run(driver: Ev3RemoteDriver, speed: int = 360, late_s: float = 0.0) -> bytes:
    """Return the next order `run`, as the driver would send it."""
    connection = driver.link._connection
    assert connection is not None
    after = driver.link.report["t"] - late_s
    order = {"do": "run", "left": speed, "right": speed, "ms": 400, "after": after}
    return wire.pack_json(order, connection._seal)


def send_bytes(driver: Ev3RemoteDriver, data: bytes) -> None:
    assert driver.link._connection is not None
    driver.link._connection.line.sendall(data)


def driven_speeds(brick: FakeBrick) -> set[int]:
    return {command.speed for command in brick.commands if command.command.startswith("run")}


# Joining ------------------------------------------------------------------------------------------


def test_a_wrong_or_missing_secret_or_address_is_reported_in_one_line(
    agent: VirtualAgent, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(
        DriveError, match=r"refuses the connection: wrong secret; give --brick-secret"
    ):
        make_driver(agent, "another secret").connect()
    with pytest.raises(DriveError, match=r"no agent answers .*refused.*drivelesson brick agent"):
        make_driver(agent, address="brick:1").connect()
    with pytest.raises(DriveError, match="address is missing; give it with --brick"):
        make_driver(agent, address="").connect()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(DriveError, match=r"no secret is known .* or make a secret"):
        make_driver(agent, "").connect()
    path = secret_path("brick")
    path.parent.mkdir(parents=True)
    path.write_text(SECRET + "\n")
    with make_driver(agent, "") as driver:
        assert driver.is_connected
    path.write_text("another")
    monkeypatch.setenv("DRIVELESSON_BRICK_SECRET", SECRET)
    with make_driver(agent, "") as driver:
        assert driver.is_connected


@pytest.mark.parametrize("address", ["ev3dev.local:x", "ev3dev.local:99999", ":8765"])
def test_an_invalid_address_is_refused_before_anything_is_sent(address: str) -> None:
    with pytest.raises(ConfigurationError, match="--brick"):
        join(address, "a secret", dial=lambda _: pytest.fail("the driver connected"))


def test_an_impostor_that_accepts_everybody_is_found_out(
    agent: VirtualAgent, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(callers.Caller, "proves", lambda *_: True)
    with pytest.raises(DriveError, match="could not prove that it knows the shared secret"):
        make_driver(agent, "another secret").connect()


def test_only_one_controller_connects_at_a_time(agent: VirtualAgent) -> None:
    with (
        make_driver(agent),
        pytest.raises(DriveError, match=r"busy: 127.0.0.1 controls the robot; stop the other"),
    ):
        make_driver(agent).connect()
    with make_driver(agent) as driver:
        assert driver.is_connected


def test_a_new_controller_replaces_a_silent_one(agent: VirtualAgent, brick: FakeBrick) -> None:
    with make_driver(agent):
        agent.cut()
        brick.clock.sleep(agent_server.SILENCE_S + 0.2)
        agent.mend()
        with make_driver(agent) as driver:
            assert driver.is_connected


def test_a_caller_that_does_not_authenticate_in_time_is_disconnected(
    agent: VirtualAgent, brick: FakeBrick
) -> None:
    line = agent.dial(BRICK)
    line.settimeout(5)
    began_s = brick.clock.now_s()
    for byte in wire.pack_json({"do": "join", "nonce": "a" * 32, "proof": "b"})[:8]:
        line.sendall(bytes([byte]))  # a slow caller may not stay
        brick.clock.sleep(0.1)
    while line.recv(1024):
        pass
    assert brick.clock.now_s() - began_s == pytest.approx(callers.JOIN_S, abs=0.06)


@pytest.mark.parametrize("noise", [b"GET / HTTP/1.1\r\n\r\n", wire.pack_json({"do": 7})])
def test_a_caller_that_sends_noise_is_disconnected(
    agent: VirtualAgent, driver: Ev3RemoteDriver, noise: bytes
) -> None:
    stranger = agent.dial(BRICK)
    stranger.sendall(noise)
    stranger.settimeout(5)
    while stranger.recv(4096):
        pass
    assert driver.rolled_m() == (0.0, 0.0)


def test_a_caller_that_never_reads_is_dropped(agent: VirtualAgent) -> None:
    connection = join(ADDRESS, SECRET, agent.dial)
    connection.line.settimeout(5)
    with pytest.raises(OSError, match="Broken pipe"):
        for _ in range(1000):
            connection.send({"do": "ping", "id": "x" * 8000})


def test_the_agent_survives_errors_of_accept() -> None:
    now_s, names = 100.0, ("EMFILE", "ECONNABORTED", "EINTR")
    listener = Listener(*(OSError(getattr(errno, name), name) for name in names))
    door = callers.CallerLimiter(listener, print)
    for _ in range(3):
        assert door.is_open(now_s)
        door.accept(now_s)
        assert not door.is_open(now_s), "the next accept would fail at once"
        now_s += callers.ACCEPT_PAUSE_S
    listener.arrived.append(connected(Net(VirtualClock()))[1])
    door.accept(now_s)
    assert len(door.callers) == 1


def test_a_flood_evicts_only_its_own_connections() -> None:
    listener, left, net = Listener(), list[str](), Net(VirtualClock())
    door = callers.CallerLimiter(listener, left.append)
    for index in range(callers.MAX_UNJOINED + 30):
        listener.arrived.append(connected(net)[1])
        listener.address = "127.0.0.3" if index == 3 else "127.0.0.2"
        door.accept(float(index))
    assert left == ["127.0.0.2 left: too many others wait to join"] * 30
    assert len(door.callers) == callers.MAX_UNJOINED
    assert "127.0.0.3" in {caller.name for caller in door.callers}


def test_a_flood_does_not_fill_the_card(capsys: pytest.CaptureFixture[str]) -> None:
    log = callers.LimitedLog()
    for index in range(100_000):
        log.note(f"{index} left")
    assert len(capsys.readouterr().out) < 2000


# Driving ------------------------------------------------------------------------------------------


def test_the_agent_stops_the_motors_500_ms_after_the_last_command(
    driver: Ev3RemoteDriver, brick: FakeBrick
) -> None:
    send_bytes(driver, sealed_run(driver))
    brick.wait_until(brick.is_moving)
    last_s = brick.commands[-1].at_s
    brick.wait_until(lambda: brick.commands[-1].command == "stop", 1)
    took_s = brick.commands[-1].at_s - last_s
    assert took_s == pytest.approx(agent_server.WATCHDOG_S, abs=0.05 + 2 * POLL_S)


def test_of_several_commands_that_were_held_up_only_the_last_counts(
    driver: Ev3RemoteDriver, agent: VirtualAgent, brick: FakeBrick
) -> None:
    assert agent._agent._body is not None
    with mock.patch.object(agent._agent._body, "run", wraps=agent._agent._body.run) as run:
        send_bytes(driver, b"".join(sealed_run(driver, speed) for speed in (100, 200, 300)))
        brick.wait_until(brick.is_moving)
    run.assert_called_once_with(300, 300, 400)
    assert driven_speeds(brick) == {300}


@pytest.mark.parametrize("late_s", [agent_server.STALE_S + 0.05, -3600.0])
def test_a_command_that_was_held_up_is_not_carried_out(
    driver: Ev3RemoteDriver, brick: FakeBrick, late_s: float
) -> None:
    send_bytes(driver, sealed_run(driver, late_s=late_s))
    driver.rolled_m()
    brick.catch_up()
    assert not brick.is_moving()
    driver.send_action(Action.FORWARD)
    brick.wait_until(brick.is_moving)


@pytest.mark.parametrize("idea", ["nonsense", "forged", "changed", "repeated"])
def test_a_message_that_the_controller_did_not_send_ends_its_connection_and_stops_the_robot(
    driver: Ev3RemoteDriver, agent: VirtualAgent, brick: FakeBrick, idea: str
) -> None:
    """Messages between agent and driver are lost, repeated or changed; see also test_wire.py."""
    driver.send_action(Action.FORWARD)
    brick.wait_until(brick.is_moving)
    order = sealed_run(driver)
    if idea == "nonsense":
        driver.link.send("run", left="fast", right=None, ms=400, after=driver.link.report["t"])
    else:
        body = wire.pack_json({"do": "run", "left": 720, "right": 720, "ms": 500, "after": 0})
        send_bytes(
            driver,
            {
                "forged": body + bytes(wire.MAC_SIZE),
                "changed": order.replace(b'"left": ', b'"left":-'),
                "repeated": order * 2,
            }[idea],
        )
    brick.wait_until(lambda: not brick.is_moving(), 0.3)
    assert driven_speeds(brick) == {360}, "the motors obeyed only the owner"
    assert agent._agent._controller is None
    driver.disconnect()
    with make_driver(agent) as again:
        again.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)


def test_a_silent_brick_is_sent_no_move(
    driver: Ev3RemoteDriver, agent: VirtualAgent, brick: FakeBrick
) -> None:
    driver.send_action(Action.FORWARD)
    brick.wait_until(brick.is_moving)
    agent.deafen()
    brick.clock.sleep(SILENCE_S + 0.05)
    with pytest.raises(DriveError, match="does not answer"):
        driver.send_action(Action.FORWARD)
    assert not brick.is_moving(), "the brick's last move has ended by itself"


def test_a_computer_that_paused_while_it_connected_still_opens_the_body(
    agent: VirtualAgent, brick: FakeBrick
) -> None:
    driver = make_driver(agent)
    driver.link.hold("test", "ping")
    agent.deafen()
    brick.clock.sleep(1.0)
    assert "does not answer" in str(driver.link.fault)
    agent.deafen(False)
    driver.connect()
    assert driver.send_action(Action.FORWARD) is Action.FORWARD
    driver.disconnect()
    driver.link.release("test")


@pytest.mark.parametrize("part", ["tacho-motor", "lego-sensor"])
def test_a_body_that_is_missing_after_a_reconnection_is_reported_until_it_is_back(
    agent: VirtualAgent, brick: FakeBrick, part: str
) -> None:
    """A restarted brick finds its motors only some seconds after its network is up."""
    clock, there = brick.clock, brick.root / "sys/class" / part
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    ports = {"left_port": "outC", "right_port": "outB", "touch_port": "in1"}
    with make_driver(agent, **ports) as driver:
        driver.send_action(Action.FORWARD)
        agent.kill()
        clock.sleep(SILENCE_S)
        with pytest.raises(DriveError, match=r"brick at brick.* was lost"):
            driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: not brick.is_moving(), 0.4)
        there.rename(brick.root / "away")
        agent.start_again()
        clock.sleep(2 * REJOIN_S)
        for _ in range(3):
            with pytest.raises(DriveError, match=r"no (left motor|touch sensor) at port .*again"):
                driver.sense()
            with pytest.raises(DriveError, match="trying again"):
                driver.send_action(Action.FORWARD)
            clock.sleep(REJOIN_S)
        (brick.root / "away").rename(there)
        clock.sleep(2 * REJOIN_S)
        assert driver.sense().bumped is False
        assert not brick.is_moving(), "the brick waits for an order"
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)


def test_motors_that_are_missing_or_do_not_answer_are_named(
    agent: VirtualAgent, brick: FakeBrick
) -> None:
    missing = make_driver(agent, left_port="outD")
    with pytest.raises(DriveError, match=r"no left motor at port outD.*outB"):
        missing.connect()
    assert not missing.is_connected
    with make_driver(agent) as driver:
        brick.wait_until(lambda: "t" in driver.link.report)
        brick.unplug_motor("outC")
        agent._agent._body.motors._ports[1].close()
        with pytest.raises(DriveError, match=r"outB and outC do not answer .*check their cabl"):
            driver.rolled_m()
        driver.link.send("states")
        with pytest.raises(DriveError, match=r"outB and outC do not answer .*check their cabl"):
            driver.link.answer("states")
        send_bytes(driver, sealed_run(driver))
        brick.wait_until(lambda: "do not answer" in str(driver.link.report.get("fault")))
        assert driver.link.fault is None, "the connection stays open"


# Sensors and the camera ---------------------------------------------------------------------------


def test_sensors_and_buttons_are_read_over_the_connection(
    agent: VirtualAgent, brick: FakeBrick
) -> None:
    brick.add_sensor("in4", "lego-ev3-us", 500, decimals=1)
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with make_driver(agent) as driver:
        brick.wait_until(lambda: driver.sense().distance_m == pytest.approx(0.5))
        brick.set_sensor("in1", 1)
        brick.wait_until(lambda: driver.sense().bumped is True)
        brick.press(28)
        pressed: list[BodyButton | None] = []
        brick.wait_until(lambda: pressed.append(driver.take_button()) or pressed[-1] is not None)
        assert pressed[-1] is BodyButton.START
        driver.announce("http://10.0.0.2:8000")
        driver.show(Mode.TRAIN)
        brick.wait_until(lambda: "10.0.0.2" in brick.screen.read_text())


def test_the_camera_of_another_robot_cannot_see_through_the_brick(brick: FakeBrick) -> None:
    driver = Ev3Driver(Ev3Options(brick_root=str(brick.root)))
    with pytest.raises(ConfigurationError, match="not with 'ev3'"):
        Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), brick.clock)
    lonely = Ev3RemoteCamera(UsbCameraOptions(), brick.clock, BrickLink("", clock=brick.clock))
    with pytest.raises(CameraError, match="address is missing; give it with --brick"):
        lonely.start()


def test_the_newest_picture_is_sent_first_and_camera_faults_are_reported(brick: FakeBrick) -> None:
    clock, source = brick.clock, SimulatedCamera()
    with VirtualAgent(brick, open_camera=source.open) as running:
        driver = make_driver(running)
        camera = Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), clock)
        with driver, camera:
            brick.wait_until(lambda: camera.latest() is not None)
            clock.sleep(1.0)
            frame = camera.latest()
            assert frame is not None and clock.now_s() - frame.captured_s < 0.12
            assert camera.source_age_s == pytest.approx(0.0, abs=0.05)
            source.is_frozen = True
            assert brick.wait_until(lambda: camera.fault is not None) <= 0.5
            brick.wait_until(lambda: "/dev/video0" in str(camera.fault), 0.2)
            source.is_frozen = False
            brick.wait_until(lambda: camera.fault is None, 0.2)
