"""MicroPython's `machine`, reduced to two motors: reports the wheels' motion, by its clock."""

import time

duties = []


def unique_id():
    return b"\xe6\x61\x38\x52"


class Pin:
    def __init__(self, number):
        self.number = number


class PWM:
    """A pin with PWM; four of these pins determine the motion of two wheels."""

    def __init__(self, pin, freq, duty_u16):
        self._place = len(duties)
        duties.append(duty_u16)

    def duty_u16(self, duty):
        """Set the share of the time for which the pin is high."""
        duties[self._place] = duty
        if self._place == 3:
            left, right = (round((duties[i] - duties[i + 1]) / 65535, 4) for i in (0, 2))
            print("wheels", time.ticks_ms(), left, right)
