"""MicroPython's `network`: this machine is already connected."""

STA_IF = 0


class WLAN:
    """A Wi-Fi interface that is connected immediately."""

    def __init__(self, kind):
        pass

    def active(self, is_on):
        """Do nothing."""

    def connect(self, name, password):
        """Do nothing."""

    def isconnected(self):
        """Always true."""
        return True

    def ifconfig(self):
        """Return the address first."""
        return ("127.0.0.1", "255.0.0.0", "127.0.0.1", "127.0.0.1")
