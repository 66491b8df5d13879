"""A hub whose light reports its colour."""

import sys


class _Light:
    def __init__(self):
        self.on("off")

    def on(self, color):
        sys.stdout.write(f"\x01light {color}\n")


class _Battery:
    def voltage(self):
        return 7150


class ThisHub:
    def __init__(self):
        self.light, self.battery = _Light(), _Battery()
