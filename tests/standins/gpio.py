"""Runs the keeper's logic in virtual time on gpiozero's mock pins, without a separate process."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Self

from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPWMPin

from robot.bodies.gpio.driver import GpioDriver, GpioOptions
from robot.bodies.gpio.keeper import make_motors
from robot.bodies.gpio.wheels import TimedMotors
from robot.bodies.remote.plain import encode_plain_report
from robot.testing import VirtualClock

MOTOR_PINS, CAR_PINS = (17, 18, 22, 23), (12, 13)


class MockPins:
    """The keeper's logic; `forward` lets time pass, and the keeper checks it every millisecond."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._motors: TimedMotors | None = None
        self.is_silent = self.is_car = self.has_phases = False

    def __enter__(self) -> Self:
        self._before = Device.pin_factory
        Device.pin_factory = self.factory = MockFactory(pin_class=MockPWMPin)
        return self

    def __exit__(self, *error: object) -> None:
        self.factory.reset()
        self.factory.close()
        Device.pin_factory = self._before

    @property
    def wheels(self) -> tuple[float, float]:
        """The motion of the left and the right motor."""
        ahead, back, right_ahead, right_back = (
            self.factory.pin(number).state for number in MOTOR_PINS
        )
        if self.has_phases:  # the first pin of each motor is its direction
            return (1 - 2 * ahead) * back, (1 - 2 * right_ahead) * right_back
        return ahead - back, right_ahead - right_back

    @property
    def car(self) -> tuple[float, float]:
        """The values of a car's servo and ESC; a pulse of 1.5 ms in 20 ms is the middle."""
        servo, esc = (round((self.factory.pin(n).state - 0.075) / 0.025, 6) for n in CAR_PINS)
        return servo, esc

    @property
    def is_moving(self) -> bool:
        return any(self.wheels) or (self.is_car and self.car[1] != 0.0)

    def freeze_program(self) -> None:
        """Lose all messages of the robot's program, and send no answers."""
        self.is_silent = True

    def hang_up(self) -> None:
        """Close the connection, as when the robot's program is killed: the keeper stops and
        ends."""
        self.is_silent = True
        if self._motors is not None:
            self._motors.stand()

    def tick(self) -> None:
        """Let the keeper check the time."""
        if self._motors is not None:
            self._motors.tick(self._now_ms())

    def forward(self, seconds: float) -> None:
        for _ in range(round(1000 * seconds)):
            self._clock.sleep(0.001)
            self.tick()

    def driver(self, options: GpioOptions) -> GpioDriver:
        """Return a driver whose keeper holds these pins."""
        driver = GpioDriver(options, self._clock)
        driver._open_line = lambda: self.open_line(driver.settings())
        return driver

    def open_line(self, settings: dict[str, Any]) -> Any:
        """Return a `MessageLine`; a wait without a message takes virtual time."""
        self.factory.reset()
        motors = self._motors = make_motors(settings)
        self.is_car = settings["servo_ends"] is not None
        self.has_phases = settings["motor_board"] == "phase-enable"
        reports: list[bytes] = []

        def send(message: bytes) -> None:
            if not self.is_silent:
                reports.append(encode_plain_report(motors.obey(message, self._now_ms())))

        def receive(timeout_s: float) -> bytes | None:
            if not reports:
                self.forward(timeout_s)
            return reports.pop(0) if reports else None

        return SimpleNamespace(send=send, receive=receive, close=motors.stand)

    def _now_ms(self) -> int:
        return int(1000 * self._clock.now_s())
