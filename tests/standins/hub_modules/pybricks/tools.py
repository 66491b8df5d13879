import time


def wait(time_ms):
    time.sleep_ms(time_ms)


class StopWatch:
    def __init__(self):
        self._start = time.ticks_ms()

    def time(self):
        return time.ticks_diff(time.ticks_ms(), self._start)
