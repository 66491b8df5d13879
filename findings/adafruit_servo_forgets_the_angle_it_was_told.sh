#!/bin/sh
# adafruit-circuitpython-motor 3.5.0, adafruit-circuitpython-pca9685 3.4.22: small steps of a servo's angle add up to
# a wrong angle, or to no movement.
#
# Guess before running: fifty times `servo.angle += 0.2` moves a servo by 10 degrees, within half a degree, and fifty
# steps back return it.
# Outcome: wrong. `angle` does not return the angle that was set, but computes it from the pulse, which was rounded
# down. Each step loses up to one unit of the pulse, and the losses add up. A PCA9685 has 12 bits, so one unit is 0.6
# degrees. Fifty steps of 0.2 do not move the servo at all, fifty steps back move it by 29 degrees, and 90 steps of 1
# degree from 0 end at 52. The same number of steps down then raises ValueError ("Angle out of range"). With 16 bits,
# fifty steps of 0.2 move the servo by 9.2 degrees, and fifty steps back by 11 degrees. A program has to store the
# angle itself. Likewise, a ContinuousServo that was told to stop reports a throttle of -0.002.
#
# A simulated I2C bus stands in for the PCA9685 and stores its registers.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    adafruit-circuitpython-motor==3.5.0 adafruit-circuitpython-pca9685==3.4.22
"$folder/env/bin/python" - <<'PY'
from types import SimpleNamespace

from adafruit_motor.servo import ContinuousServo, Servo
from adafruit_pca9685 import PCA9685


class Bus:
    """An I2C bus with a PCA9685, whose registers count up as they are read and written."""

    def __init__(self) -> None:
        self.registers = bytearray(256)

    def try_lock(self) -> bool:
        return True

    def unlock(self) -> None:
        pass

    def writeto(self, address: int, data: bytes, *, start: int = 0, end: int | None = None) -> None:
        if sent := data[start:end]:  # empty when the driver looks for the board
            self.registers[sent[0] : sent[0] + len(sent) - 1] = sent[1:]

    def writeto_then_readfrom(
        self, address: int, out: bytes, answer: bytearray, *, out_start: int = 0, out_end: int | None = None,
        in_start: int = 0, in_end: int | None = None,
    ) -> None:
        places = range(*slice(in_start, in_end).indices(len(answer)))
        for number, place in enumerate(places):
            answer[place] = self.registers[out[out_start] + number]


def stepped(servo: Servo, angle: float, step: float, count: int) -> float:
    """Return a servo's angle after `count` steps of `step` degrees from `angle`."""
    servo.angle = angle
    for _ in range(count):
        servo.angle += step
    return round(servo.angle, 1)


board = PCA9685(Bus())
board.frequency = 50
found = {}
for name, output in (("12 bits", board.channels[0]), ("16 bits", SimpleNamespace(frequency=50, duty_cycle=0))):
    servo = Servo(output)
    found[name] = [stepped(servo, 90, 0.2, 50), stepped(servo, 90, -0.2, 50), stepped(servo, 0, 1, 90)]
    refused = False
    try:
        for _ in range(90):
            servo.angle -= 1
    except ValueError as error:
        refused = str(error) == "Angle out of range"
    wheel = ContinuousServo(output)
    wheel.throttle = 0
    print(f"{name}: 90 + 50 x 0.2, 90 - 50 x 0.2, 90 x 1: {found[name]}; down refused: {refused}; {wheel.throttle:.4f}")
    assert refused and wheel.throttle < 0
assert found == {"12 bits": [89.8, 60.5, 52.3], "16 bits": [99.1, 79.0, 89.0]}
PY
