"""The brick's buttons, lights and screen.

No function of this module raises, so a robot without buttons, lights or screen can drive, too.
"""

import os
import struct
from typing import Optional

try:
    import fcntl
except ImportError:  # Windows does not have this module
    fcntl = None  # type: ignore[assignment]

LIGHTS = {"stopped": (0, 1), "train": (1, 1), "autonomous": (1, 0)}
"""Brightness of red and green for each mode."""
KEY_EVENT = struct.Struct("@llHHi")
EV_KEY, KEY_BACK, KEY_ENTER = 1, 14, 28
EVIOCGRAB = 0x40044590
VT_GETSTATE, VT_ACTIVATE = 0x5603, 0x5606
SCREEN = 6
MENU_S = 3.0
"""Time for which the Back button must be held to return buttons and screen to the brick's menu, in
seconds. The menu is needed to switch the brick off."""


class Console:
    """The buttons, lights and screen of the brick whose files are below one root folder. The first
    `show` takes over lights and screen."""

    def __init__(self, root: str) -> None:
        self._root = root
        self._keys = -1
        self._back_since_s = None  # type: Optional[float]
        self._shown = ""
        self._screen_before = None  # type: Optional[int]

    def open(self) -> None:
        """Grab the buttons, so that the brick's menu does not receive them."""
        if fcntl is None:
            return
        path = os.path.join(self._root, "dev/input/by-path/platform-gpio_keys-event")
        try:
            if self._keys < 0:
                self._keys = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError:
            return
        self._grab(1)

    def _grab(self, take: int) -> None:
        try:
            fcntl.ioctl(self._keys, EVIOCGRAB, take)
        except OSError:
            pass  # there is no input device, or another program has grabbed it

    def take_button(self) -> Optional[str]:
        """Return "start" if the middle button was pressed since the last call, "stop" if another
        button was pressed, and None if no button was pressed."""
        pressed = None
        while self._keys >= 0:
            try:
                event = os.read(self._keys, KEY_EVENT.size)
            except OSError:
                break  # there are no more button events
            if len(event) < KEY_EVENT.size:
                break
            second, micro, kind, code, value = KEY_EVENT.unpack(event)
            if kind != EV_KEY:
                continue
            if code == KEY_BACK:
                self._note_back(second + micro / 1e6, value)
            if value == 1:
                pressed = "start" if code == KEY_ENTER and pressed != "stop" else "stop"
        # While the brick's menu is on the screen, the menu uses the middle button.
        return pressed if self._shown or pressed != "start" else None

    def _note_back(self, at_s: float, value: int) -> None:
        if value == 1:
            self._back_since_s = at_s
        elif value == 0 and self._back_since_s is not None:
            if at_s - self._back_since_s >= MENU_S:
                self._grab(0)
                self._give_screen_back()
                self._shown = ""
            self._back_since_s = None

    def show(self, mode: str, address: str) -> None:
        """Show mode and address on the screen, and the mode with the lights, as far as the brick
        has them."""
        text = "Drivelesson\r\n\n{}\r\n\n{}\r\n".format(mode, address)
        if text == self._shown:
            return
        if not self._shown and self._keys >= 0:
            self._grab(1)  # the menu may have taken the buttons
        self._shown = text
        red, green = LIGHTS.get(mode, (0, 1))
        for side in (0, 1):
            self._light("led{}:red:brick-status".format(side), red)
            self._light("led{}:green:brick-status".format(side), green)
        try:
            with open(os.path.join(self._root, "dev/tty{}".format(SCREEN)), "w") as screen:
                screen.write("\033[2J\033[H" + text)
                if screen.isatty():
                    self._bring_to_front(screen.fileno())
        except OSError:
            pass  # this is not a brick, or the program may not open the device

    def _bring_to_front(self, screen: int) -> None:
        state = fcntl.ioctl(screen, VT_GETSTATE, bytes(6))
        active = struct.unpack_from("=H", state)[0]
        if active != SCREEN:
            self._screen_before = active
        fcntl.ioctl(screen, VT_ACTIVATE, SCREEN)

    def _give_screen_back(self) -> None:
        if self._screen_before is None:
            return
        try:
            with open(os.path.join(self._root, "dev/tty{}".format(SCREEN)), "w") as screen:
                fcntl.ioctl(screen, VT_ACTIVATE, self._screen_before)
        except OSError:
            pass
        self._screen_before = None

    def _light(self, name: str, share: int) -> None:
        path = os.path.join(self._root, "sys/class/leds", name)
        try:
            with open(os.path.join(path, "max_brightness")) as file:
                brightness = int(file.readline()) * share
            with open(os.path.join(path, "brightness"), "w") as file:
                file.write("{}\n".format(brightness))
        except OSError:
            pass

    def close(self) -> None:
        """Give the buttons and the screen back to the brick's menu; idempotent."""
        self._give_screen_back()
        self._shown = ""
        if self._keys >= 0:
            os.close(self._keys)  # closing the device also ends the grab
            self._keys = -1
