"""MicroPython's `machine`, as far as two motors go: says what the wheels do, by its clock."""

import time

_duties = []


def unique_id():
    """Return the chip's number."""
    return b"\xe6\x61\x38\x52"


class Pin:
    """A pin has a number."""

    def __init__(self, number):
        self.number = number


class PWM:
    """Four make two wheels; the last that is set says what they do."""

    def __init__(self, pin, freq, duty_u16):
        self._place = len(_duties)
        _duties.append(duty_u16)

    def duty_u16(self, duty):
        """Set the share of the time for which the pin is high."""
        _duties[self._place] = duty
        if self._place == 3:
            left, right = (round((_duties[i] - _duties[i + 1]) / 65535, 4) for i in (0, 2))
            print("wheels", time.ticks_ms(), left, right)
