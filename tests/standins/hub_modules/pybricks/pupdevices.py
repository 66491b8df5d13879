"""Motors that report their orders, in separate lines that begin with a byte 1."""

import sys

from pybricks.parameters import Direction, Stop


def _say(*words):
    sys.stdout.write("\x01{}\n".format(" ".join(str(word) for word in words)))


class Motor:
    def __init__(self, port, positive_direction=Direction.CLOCKWISE):
        self._port, self._sign = port, positive_direction

    def run_time(self, speed, time, then=Stop.HOLD, wait=True):
        assert not wait, "the program would block during the whole move"
        assert speed and time > 0
        _say("motor", self._port, self._sign * speed, int(time))

    def brake(self):
        _say("motor", self._port, 0, 0)


class UltrasonicSensor:
    def __init__(self, port):
        assert port == "E"

    def distance(self):
        return 420


class ForceSensor:
    def __init__(self, port):
        raise OSError(19, "no device")
