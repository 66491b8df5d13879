"""MicroPython's `network`: this machine is already connected."""

STA_IF = 0


class WLAN:
    """A Wi-Fi interface that is connected immediately."""

    def __init__(self, kind):
        self.active = bool
        self.isconnected = lambda: True
        self.connect = lambda name, password: None
        self.ifconfig = lambda: ("127.0.0.1", "255.0.0.0", "127.0.0.1", "127.0.0.1")
