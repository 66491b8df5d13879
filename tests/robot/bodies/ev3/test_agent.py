"""The agent, and the driver's use of a connection to it, in virtual time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.bodies.ev3.agent import server as agent_server
from robot.bodies.ev3.agent import wire
from robot.bodies.ev3.fake_brick import POLL_S, FakeBrick
from robot.bodies.ev3.handshake import join, secret_path
from robot.bodies.ev3.link import REJOIN_S, SILENCE_S, BrickLink
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.driver import BodyButton
from robot.errors import CameraError, ConfigurationError, DriveError
from robot.types import Action, Mode
from tests.robot.bodies.ev3.running_agent import SECRET
from tests.robot.bodies.ev3.virtual_agent import MadeUpCamera, VirtualAgent

STEP_S = 0.005


def make_driver(
    agent: VirtualAgent, secret: str = SECRET, address: str = VirtualAgent.address, **options: str
) -> Ev3RemoteDriver:
    found = Ev3RemoteOptions(brick=address, **options)
    return Ev3RemoteDriver(found, agent.link(secret, address))


class Controller:
    """A program that speaks the agent's protocol by hand."""

    def __init__(self, agent: VirtualAgent, secret: str = SECRET) -> None:
        self.connection = join(agent.address, secret, agent.dial)
        self.connection.line.settimeout(5)
        self.waiting: list[dict[str, object]] = []
        self.last_report_s = 0.0

    def send(self, **command: object) -> None:
        self.connection.send(command)

    def read(self, key: str) -> object:
        """Return this field of the next message that has it; other messages are skipped."""
        while True:
            while self.waiting:
                message = self.waiting.pop(0)
                if key in message:
                    return message[key]
            for kind, body in self.connection.receive():
                if kind == b"J":
                    self.waiting.append(json.loads(body))
                    self.last_report_s = self.waiting[-1].get("t", self.last_report_s)

    def open(self) -> None:
        self.send(do="open", left="outB", right="outC", ultrasonic="auto", touch="auto")
        self.read("opened")

    def drain(self) -> None:
        """Receive everything that waits, so that the newest report is really new."""
        self.send(do="ping", id=1)
        self.read("pong")
        self.read("t")

    def run(self, late_s: float = 0.0, speed: float = 360) -> None:
        self.drain()
        after = self.last_report_s - late_s
        self.send(do="run", left=speed, right=speed, ms=400, after=after)

    def hang_up(self) -> None:
        self.connection.line.close()


@pytest.fixture
def controller(agent: VirtualAgent) -> Iterator[Controller]:
    one = Controller(agent)
    one.open()
    yield one
    one.hang_up()


def test_a_wrong_or_missing_secret_or_address_is_one_clear_line(
    agent: VirtualAgent, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(DriveError, match=r"refuses: wrong secret; give --brick-secret"):
        make_driver(agent, "another secret").connect()
    with pytest.raises(DriveError, match=r"no agent answers .*refused.*drivelesson brick agent"):
        make_driver(agent, address="brick:1").connect()
    with pytest.raises(DriveError, match="no brick was named"):
        make_driver(agent, address="").connect()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(DriveError, match=r"no secret is known .* or make a secret"):
        make_driver(agent, "").connect()
    path = secret_path("brick")
    path.parent.mkdir(parents=True)
    path.write_text(SECRET + "\n")
    with make_driver(agent, "") as driver:
        assert driver.is_connected


def test_a_missing_motor_is_named_over_the_connection(agent: VirtualAgent) -> None:
    driver = make_driver(agent, left_port="outD")
    with pytest.raises(DriveError, match=r"no left motor at port outD.*outB"):
        driver.connect()
    assert not driver.is_connected


def test_only_one_controller_connects_at_a_time(
    agent: VirtualAgent, controller: Controller
) -> None:
    with pytest.raises(DriveError, match=r"busy: 127.0.0.1 has the robot; stop the other"):
        make_driver(agent).connect()
    controller.hang_up()
    with make_driver(agent) as driver:
        assert driver.is_connected


def test_a_new_controller_replaces_a_silent_one(agent: VirtualAgent) -> None:
    silent = Controller(agent)
    silent.open()
    agent.net.clock.sleep(agent_server.SILENCE_S + 0.2)
    with make_driver(agent) as driver:
        assert driver.is_connected
    silent.hang_up()


def test_the_agent_stops_the_motors_500_ms_after_the_last_command(
    controller: Controller, brick: FakeBrick
) -> None:
    controller.run()
    brick.wait_until(brick.is_moving)
    last_s = brick.commands[-1].at_s
    brick.wait_until(lambda: brick.commands[-1].command == "stop", 1)
    took_s = brick.commands[-1].at_s - last_s
    assert took_s == pytest.approx(agent_server.WATCHDOG_S, abs=0.05 + 2 * POLL_S), "and a tick"


def test_of_several_commands_that_were_held_up_only_the_last_counts(
    controller: Controller, brick: FakeBrick
) -> None:
    brick.catch_up()
    before = len(brick.commands)
    controller.drain()
    sealed = [
        wire.pack_json(
            {"do": "run", "left": v, "right": v, "ms": 400, "after": controller.last_report_s},
            controller.connection._seal,
        )
        for v in (100, 200, 300)
    ]
    controller.connection.line.sendall(b"".join(sealed))
    brick.wait_until(brick.is_moving)
    assert {command.speed for command in brick.commands[before:]} == {300}


@pytest.mark.parametrize("late_s", [agent_server.STALE_S + 0.05, 1.0, 3600.0, -3600.0])
def test_a_command_that_was_held_up_is_not_carried_out(
    controller: Controller, brick: FakeBrick, late_s: float
) -> None:
    controller.run(late_s)
    controller.send(do="positions")
    controller.read("positions")
    brick.catch_up()
    assert not brick.is_moving()
    controller.run()
    brick.wait_until(brick.is_moving)


@pytest.mark.parametrize(
    "noise",
    [b"GET / HTTP/1.1\r\n\r\n", b"J\xff\xff\xff\xff", wire.pack_json({"do": 7}), b"J" * 99],
)
def test_a_caller_that_sends_noise_is_disconnected(
    agent: VirtualAgent, controller: Controller, noise: bytes
) -> None:
    stranger = agent.dial(("brick", 8765))
    stranger.sendall(noise)
    stranger.settimeout(5)
    while stranger.recv(4096):
        pass
    controller.send(do="positions")
    assert controller.read("positions") == [0.0, 0.0]


def test_after_nonsense_from_its_controller_the_robot_stands(
    agent: VirtualAgent, controller: Controller, brick: FakeBrick
) -> None:
    controller.run()
    brick.wait_until(brick.is_moving)
    controller.send(do="run", left="fast", right=None, ms=400, after=controller.last_report_s)
    brick.wait_until(lambda: not brick.is_moving(), 0.3)
    with make_driver(agent) as driver:
        assert driver.is_connected


def test_sensors_and_buttons_are_read_over_the_connection(brick: FakeBrick) -> None:
    brick.add_sensor("in4", "lego-ev3-us", 500, decimals=1)
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with VirtualAgent(brick) as running, make_driver(running) as driver:
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
    from robot.bodies.ev3.driver import Ev3Driver, Ev3Options

    driver = Ev3Driver(Ev3Options(brick_root=str(brick.root)))
    with pytest.raises(ConfigurationError, match="not with 'ev3'"):
        Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), brick.clock)
    lonely = Ev3RemoteCamera(UsbCameraOptions(), brick.clock, BrickLink("", clock=brick.clock))
    with pytest.raises(CameraError, match="no brick was named"):
        lonely.start()


def test_the_newest_picture_is_sent_first_and_camera_faults_are_reported(brick: FakeBrick) -> None:
    clock, source = brick.clock, MadeUpCamera()
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


@pytest.mark.parametrize("address", ["ev3dev.local:x", "ev3dev.local:99999", ":8765"])
def test_an_invalid_address_is_refused_before_anything_is_sent(address: str) -> None:
    with pytest.raises(ConfigurationError, match="--brick"):
        join(address, "a secret", dial=lambda _: pytest.fail("it was dialled"))


def test_a_lost_connection_is_reported_and_opened_again(brick: FakeBrick) -> None:
    with VirtualAgent(brick) as first, make_driver(first) as driver:
        driver.send_action(Action.FORWARD)
        first.kill()

        def is_said() -> bool:
            try:
                driver.send_action(Action.FORWARD)
            except DriveError as error:
                return "brick at brick" in str(error)
            return False

        assert brick.wait_until(is_said) <= SILENCE_S
        brick.wait_until(lambda: not brick.is_moving(), 0.4)
        first.start_again()

        def drives() -> bool:
            try:
                return driver.send_action(Action.FORWARD) is Action.FORWARD
            except DriveError:
                return False

        assert brick.wait_until(drives) < 2 * REJOIN_S
        brick.wait_until(brick.is_moving)


@pytest.mark.parametrize("part", ["tacho-motor", "lego-sensor"])
def test_a_body_that_is_not_back_with_the_connection_is_reported_until_it_is(
    brick: FakeBrick, part: str
) -> None:
    """A restarted brick knows its motors only some seconds after its network."""
    clock, there = brick.clock, brick.root / "sys/class" / part
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with (
        VirtualAgent(brick) as running,
        make_driver(running, left_port="outC", right_port="outB", touch_port="in1") as driver,
    ):
        running.kill()
        clock.sleep(1.0)
        there.rename(brick.root / "away")
        running.start_again()
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
        assert not brick.is_moving(), "it waits for an order"
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)


def test_motors_that_do_not_answer_are_named_and_the_connection_stays(
    brick: FakeBrick, agent: VirtualAgent
) -> None:
    with make_driver(agent) as driver:
        brick.unplug_motor("outC")
        agent._agent._body.motors._ports[1].close()
        with pytest.raises(DriveError, match=r"outB and outC do not answer .*check their cabl"):
            driver.rolled_m()
        driver.link.send("states")
        with pytest.raises(DriveError, match=r"outB and outC do not answer .*check their cabl"):
            driver.link.answer("states")
        assert driver.link.fault is None


def test_a_computer_that_paused_while_it_connected_still_opens_the_body(
    brick: FakeBrick,
) -> None:
    clock = brick.clock
    with VirtualAgent(brick) as running:
        driver = make_driver(running)
        driver.link.hold("test", "ping")
        running.deafen()
        clock.sleep(1.0)
        assert "does not answer" in str(driver.link.fault)
        running.hear_again()
        driver.connect()
        assert driver.send_action(Action.FORWARD) is Action.FORWARD
        driver.disconnect()
        driver.link.release("test")


def test_a_silent_brick_is_sent_no_move(brick: FakeBrick) -> None:
    with VirtualAgent(brick) as running, make_driver(running) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)
        running.deafen()
        brick.clock.sleep(SILENCE_S + 0.05)
        with pytest.raises(DriveError, match="does not answer"):
            driver.send_action(Action.FORWARD)
        assert not brick.is_moving(), "its last move has ended by itself"
