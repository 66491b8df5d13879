"""The process that holds the pins, on gpiozero's mock pins; it notes the values that are set.

`python -m tests.standins.gpio_keeper NOTES JSON`; a line of NOTES is `SECONDS PIN VALUE`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPWMPin

from robot.bodies.gpio import keeper

_notes = Path(sys.argv.pop(1)).open("a", buffering=1)  # noqa: SIM115 - as long as the process


class NotedPin(MockPWMPin):
    """Reports each change of a pin."""

    def _change_state(self, value: Any) -> Any:
        _notes.write(f"{time.monotonic()} {self.info.name} {float(value)}\n")
        return super()._change_state(value)


if __name__ == "__main__":
    Device.pin_factory = MockFactory(pin_class=NotedPin)
    keeper.main()
