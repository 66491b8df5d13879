"""The agent as a process of its own, and what the driver makes of a line to it."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from robot.brick.agent import server as agent_server
from robot.brick.agent import wire
from robot.brick.archive import make_agent
from robot.brick.handshake import join, secret_path
from robot.brick.link import BrickLink
from robot.cameras.ev3_remote import Ev3RemoteCamera
from robot.capture.options import UsbCameraOptions
from robot.clock import RealClock
from robot.driver import BodyButton
from robot.drivers.ev3_remote import Ev3RemoteDriver, Ev3RemoteOptions
from robot.errors import CameraError, ConfigurationError, DriveError
from robot.testing.brick import FakeBrick
from robot.types import Action, Frame, Mode
from tests.brick.fake_video import DEVICE, QUICK, FakeVideo
from tests.brick.running_agent import SECRET, RunningAgent


def make_driver(address: str, secret: str = SECRET, **options: str) -> Ev3RemoteDriver:
    return Ev3RemoteDriver(
        Ev3RemoteOptions(brick=address, brick_secret=secret, **options)  # type: ignore[arg-type]
    )


def wait_until(is_so: Callable[[], bool], timeout_s: float = 5.0) -> float:
    started_s = time.monotonic()
    while not is_so():
        assert time.monotonic() - started_s < timeout_s, "waited in vain"
        time.sleep(0.005)
    return time.monotonic() - started_s


class Controller:
    """A program that speaks the agent's protocol by hand."""

    def __init__(self, address: str, secret: str = SECRET) -> None:
        self.connection = join(address, secret)
        self.connection.line.settimeout(5)
        self.waiting: list[dict[str, object]] = []
        self.last_report_s = 0.0

    def send(self, **command: object) -> None:
        self.connection.send(command)

    def read(self, key: str) -> object:
        """Return the next message's field of this name; others are passed over."""
        while True:
            while self.waiting:
                message = self.waiting.pop(0)
                if key in message:
                    return message[key]
            for kind, body in self.connection.receive():
                if kind == b"J":
                    self.waiting.append(json.loads(body))
                    self.last_report_s = self.waiting[-1].get("t", self.last_report_s)  # type: ignore[assignment]

    def open(self) -> None:
        self.send(do="open", left="outB", right="outC", ultrasonic="auto", touch="auto")
        self.read("opened")

    def drain(self) -> None:
        """Take in all that is waiting, so that the newest report is really new."""
        self.send(do="ping", id=1)
        self.read("pong")
        self.read("t")

    def run(self, late_s: float = 0.0, speed: float = 360) -> None:
        self.drain()
        after = self.last_report_s - late_s
        self.send(do="run", left=speed, right=speed, ms=400, after=after)

    def hang_up(self) -> None:
        self.connection.close()


@pytest.fixture
def controller(running_agent: RunningAgent) -> Iterator[Controller]:
    one = Controller(running_agent.address)
    one.open()
    yield one
    one.hang_up()


def test_a_wrong_secret_is_one_clear_line(running_agent: RunningAgent) -> None:
    with pytest.raises(DriveError, match=r"refuses: wrong secret; give --brick-secret"):
        make_driver(running_agent.address, "another secret").connect()


def test_nobody_listening_is_one_clear_line() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(DriveError, match=r"no agent answers .*refused.*drivelesson brick agent"):
        make_driver(address).connect()


def test_no_address_and_no_secret_are_one_clear_line(
    running_agent: RunningAgent, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(DriveError, match="which brick"):
        make_driver("").connect()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(DriveError, match=r"no secret is known .* make one"):
        make_driver(running_agent.address, "").connect()
    path = secret_path("127.0.0.1")
    path.parent.mkdir(parents=True)
    path.write_text(SECRET + "\n")
    with make_driver(running_agent.address, "") as driver:
        assert driver.is_connected


def test_something_else_that_answers_is_one_clear_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        other = subprocess.Popen(
            [
                sys.executable,
                "-c",
                "import socket,sys; s=socket.create_connection(('127.0.0.1',"
                f"{listener.getsockname()[1]})); s.close()",
            ]
        )
        other.wait()
        line, _ = listener.accept()
        line.close()
    with pytest.raises(ValueError, match="not a message"):
        unpacker = wire.Unpacker(wire.BEFORE_JOINING)
        unpacker.feed(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        unpacker.next()


def test_a_missing_motor_is_named_through_the_line(running_agent: RunningAgent) -> None:
    driver = make_driver(running_agent.address, left_port="outD")
    with pytest.raises(DriveError, match=r"no left motor at port outD.*outB"):
        driver.connect()
    assert not driver.is_connected


def test_one_controller_at_a_time(running_agent: RunningAgent, controller: Controller) -> None:
    with pytest.raises(DriveError, match=r"busy: 127.0.0.1 has the robot; stop the other"):
        make_driver(running_agent.address).connect()
    controller.hang_up()
    with make_driver(running_agent.address) as driver:
        assert driver.is_connected


def test_a_silent_controller_makes_room(running_agent: RunningAgent) -> None:
    silent = Controller(running_agent.address)
    silent.open()
    time.sleep(agent_server.SILENCE_S + 0.2)
    with make_driver(running_agent.address) as driver:
        assert driver.is_connected
    silent.hang_up()


def test_the_agent_stops_the_motors_500_ms_after_the_last_command(
    controller: Controller, brick: FakeBrick
) -> None:
    controller.run()
    brick.wait_until(brick.is_moving)
    last_s = brick.commands[-1].at_s
    brick.wait_until(lambda: brick.commands[-1].command == "stop", 1)
    assert 0.45 <= brick.commands[-1].at_s - last_s < 0.65  # the made-up kernel looks when it can


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
def test_noise_is_shown_out_and_harms_nobody(
    running_agent: RunningAgent, controller: Controller, noise: bytes
) -> None:
    host, port = running_agent.address.split(":")
    with socket.create_connection((host, int(port)), timeout=5) as stranger:
        stranger.sendall(noise)
        stranger.settimeout(5)
        while stranger.recv(4096):
            pass
    controller.send(do="positions")
    assert controller.read("positions") == [0.0, 0.0]


def test_a_controller_that_talks_nonsense_leaves_a_standing_robot(
    running_agent: RunningAgent, controller: Controller, brick: FakeBrick
) -> None:
    controller.run()
    brick.wait_until(brick.is_moving)
    controller.send(do="run", left="fast", right=None, ms=400, after=controller.last_report_s)
    brick.wait_until(lambda: not brick.is_moving(), 0.3)
    with make_driver(running_agent.address) as driver:
        assert driver.is_connected


def test_sensors_and_buttons_come_through_the_line(brick: FakeBrick, tmp_path: Path) -> None:
    brick.add_sensor("in4", "lego-ev3-us", 500, decimals=1)
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with RunningAgent(brick.root, tmp_path) as running, make_driver(running.address) as driver:
        wait_until(lambda: driver.sense().distance_m == pytest.approx(0.5))
        brick.set_sensor("lego-ev3-touch", 1)
        wait_until(lambda: driver.sense().bumped is True)
        brick.press(28)
        pressed: list[BodyButton | None] = []
        wait_until(lambda: pressed.append(driver.take_button()) or pressed[-1] is not None)
        assert pressed[-1] is BodyButton.START
        driver.announce("http://10.0.0.2:8000")
        driver.show(Mode.TRAIN)
        wait_until(lambda: "10.0.0.2" in brick.screen.read_text())


def test_a_line_that_was_lost_is_said_and_joined_again(brick: FakeBrick, tmp_path: Path) -> None:
    first = RunningAgent(brick.root, tmp_path)
    port = first.address.split(":")[1]
    with first, make_driver(first.address) as driver:
        driver.send_action(Action.FORWARD)
        first.process.kill()
        first.process.wait()

        def is_said() -> bool:
            try:
                driver.send_action(Action.FORWARD)
            except DriveError as error:
                return "brick at 127.0.0.1" in str(error)
            return False

        wait_until(is_said, 1.0)
        with RunningAgent(brick.root, tmp_path, port=port):

            def drives() -> bool:
                try:
                    return driver.send_action(Action.FORWARD) is Action.FORWARD
                except DriveError:
                    return False

            wait_until(drives)
            brick.wait_until(brick.is_moving)


def _is_fresh(frame: Frame | None) -> bool:
    return frame is not None and frame.age_s(time.monotonic()) < 0.2


def test_the_camera_comes_newest_first_and_its_faults_are_said(
    brick: FakeBrick, tmp_path: Path
) -> None:
    video = FakeVideo(tmp_path, QUICK)
    options = UsbCameraOptions(device=DEVICE)
    with RunningAgent(brick.root, tmp_path, video.env) as running:
        driver = make_driver(running.address)
        camera = Ev3RemoteCamera.for_driver(driver, options, RealClock())
        with driver, camera:
            wait_until(lambda: _is_fresh(camera.latest()))
            video.behave("freeze")
            assert wait_until(lambda: camera.fault is not None) <= 0.5
            wait_until(lambda: DEVICE in str(camera.fault), 2)
            video.behave("run")
            wait_until(lambda: camera.fault is None)


def test_the_camera_of_another_robot_cannot_see_through_the_brick(brick: FakeBrick) -> None:
    from robot.drivers.ev3 import Ev3Driver, Ev3Options

    driver = Ev3Driver(Ev3Options(brick_root=str(brick.root)))
    with pytest.raises(ConfigurationError, match="not 'ev3'"):
        Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), RealClock())
    lonely = Ev3RemoteCamera(UsbCameraOptions(), RealClock(), BrickLink(""))
    with pytest.raises(CameraError, match="which brick"):
        lonely.start()


def test_others_may_not_read_the_secret(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text(SECRET)
    secret.chmod(0o644)
    archive = tmp_path / "agent.pyz"
    archive.write_bytes(make_agent())
    done = subprocess.run(
        [sys.executable, archive, "--secret-file", secret],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "chmod 600" in done.stderr
