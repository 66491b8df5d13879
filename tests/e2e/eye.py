"""A phone that is the robot's eye, in Chromium: its fake camera shows recorded footage.

`python -m tests.e2e.eye FIRST.npz SECOND.npz` measures the age of the pictures that the policy
gets, and the rate with and without a CPU six times slower. It compares learning from these pictures
with learning from the same pictures of the recording.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.exchange.npz import load_recording
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.types import Action, Frame
from server.app import create_app
from server.config import Config
from server.lab.served import served
from server.services import make_services
from tests.e2e.world import running_chromium
from tests.server.live_robot import WEB

PLAYED_HZ = 30
"""Speed at which the film is played for the measurement."""


def write_film(path: Path, pictures: NDArray[np.uint8], rate_hz: int = 10) -> None:
    """Write pictures (n, height, width, 3) in a format that the fake camera plays, without JPEGs.

    Each pixel becomes several equal ones: a blurred picture would differ from the recording's.
    """
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W640 H480 F{rate_hz}:1 Ip C420jpeg\n".encode())
        for picture in pictures:
            large = cv2.resize(picture, (640, 480), interpolation=cv2.INTER_NEAREST)
            file.write(b"FRAME\n" + cv2.cvtColor(large, cv2.COLOR_RGB2YUV_I420).tobytes())


@contextlib.contextmanager
def robot_with_an_eye() -> Iterator[tuple[Rig, str]]:
    """Serve a body that notes its orders, with the camera `phone`."""
    clock = RealClock()
    camera = PhoneCamera(PhoneOptions(), clock)
    rig = Rig(ReplayDriver(), camera, make_policy("default-32"), clock)
    config = Config(port=0, web=WEB)
    with rig, served(create_app(make_services(config, rig)), config) as address:
        yield rig, address


@contextlib.contextmanager
def phone_with_film(film: Path) -> Iterator[Any]:
    """Start a Chromium whose camera shows the film, and which gives pages the camera without
    asking."""
    flags = (
        "--use-fake-ui-for-media-stream",
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-video-capture={film}",
        "--autoplay-policy=no-user-gesture-required",
    )
    with running_chromium(*flags) as browser:
        context = browser.new_context(
            viewport={"width": 390, "height": 844}, permissions=["camera"], has_touch=True
        )
        yield context
        context.close()


class Watch:
    """Notes each picture that the loop gets, and its age at that time."""

    def __init__(self, rig: Rig) -> None:
        self.frames: list[Frame] = []
        self.ages_ms: list[float] = []
        self._clock = rig.clock
        self._news = threading.Condition()
        rig.loop.need_picture_every(0.0)  # a robot that stands skips pictures that nobody needs
        self.end = rig.loop.subscribe(self._note)

    def _note(self, tick: Any) -> None:
        if tick.frame is not None:
            with self._news:
                self.frames.append(tick.frame)
                self.ages_ms.append(1000 * (self._clock.now_s() - tick.frame.captured_s))
                self._news.notify_all()

    def forget(self) -> None:
        self.frames.clear()
        self.ages_ms.clear()

    def wait_for(self, count: int, timeout_s: float = 60.0) -> None:
        with self._news:
            assert self._news.wait_for(lambda: len(self.frames) >= count, timeout_s)


def rate_hz(frames: list[Frame]) -> float:
    return (len(frames) - 1) / (frames[-1].captured_s - frames[0].captured_s)


PARTS = 5
"""Number of learners that are averaged, each without another part of the lesson, because noise that
nobody sees changes the figure of one by a point."""


def accuracy(lessons: list[tuple[Frame, Action]], trial: list[tuple[Frame, Action]]) -> float:
    """Learn one drive, and return the share of the other drive's pictures that is proposed
    correctly."""
    right = 0
    for part in range(PARTS):
        policy = make_policy("default-32")
        for number, (frame, label) in enumerate(lessons):
            if PARTS * number // len(lessons) != part:
                policy.learn(policy.extract(frame), label)
        right += sum(
            policy.propose(index, policy.extract(frame)).action is label
            for index, (frame, label) in enumerate(trial)
        )
    return right / (PARTS * len(trial))


def follow(received: list[Frame], small: NDArray[np.float32]) -> dict[int, Frame]:
    """Return the source picture of each picture: the most similar one of those due at that moment.

    A robot that stands takes many similar pictures, and the film's speed distinguishes them.
    """
    found: dict[int, Frame] = {}
    due, last_s = 0.0, received[0].captured_s
    around = np.arange(len(small)) - len(small) // 2  # anywhere, for the first
    for frame in received:
        seen = cv2.resize(to_rgb(frame), (32, 24), interpolation=cv2.INTER_AREA).astype(np.float32)
        due += PLAYED_HZ * (frame.captured_s - last_s)
        candidates = (round(due) + around) % len(small)
        unlike = np.abs(small[candidates] - seen).mean(axis=(1, 2, 3)) + 0.01 * np.abs(around)
        best = int(unlike.argmin())
        found[int(candidates[best])] = frame
        due, last_s = float(round(due) + around[best]), frame.captured_s
        around = np.arange(-10, 11)
    return found


def measure(first: Path, second: Path) -> None:
    """Print the figures for two drives of one place."""
    drives = [load_recording(path).shots for path in (first, second)]
    sources = [shot.frame(i, 0.0) for shots in drives for i, shot in enumerate(shots, start=1)]
    labels = [shot.label for shots in drives for shot in shots if shot.label is not None]
    pictures = np.stack([to_rgb(frame) for frame in sources])
    small = np.stack(
        [cv2.resize(p, (32, 24), interpolation=cv2.INTER_AREA) for p in pictures]
    ).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder, robot_with_an_eye() as (rig, address):
        film = Path(folder) / "film.y4m"
        # The page takes every second picture: with an odd number, it takes the others in the next
        # round.
        write_film(film, pictures[: (len(pictures) - 1) // 2 * 2 + 1], PLAYED_HZ)
        with phone_with_film(film) as context:
            page = context.new_page()
            page.goto(address + "/eye")
            watch = Watch(rig)
            watch.wait_for(30)
            watch.forget()
            watch.wait_for(int(len(pictures) / PLAYED_HZ * 31), timeout_s=400.0)  # two rounds
            received, ages = list(watch.frames), list(watch.ages_ms)
            print(f"pictures {received[0].width}x{received[0].height}: {rate_hz(received):.1f} Hz")
            print(
                "age at the policy, ms: "
                + ", ".join(f"p{p} {np.percentile(ages, p):.0f}" for p in (50, 95, 99))
            )
            session = page.context.new_cdp_session(page)
            session.send("Emulation.setCPUThrottlingRate", {"rate": 6})
            watch.forget()
            watch.wait_for(100)
            print(f"CPU six times slower: {rate_hz(list(watch.frames)):.1f} Hz")
            watch.end()
    seen = follow(received, small)
    split = len(drives[0])
    shares = []
    for of in (seen, dict(enumerate(sources))):
        pairs = [
            [(of[i], labels[i]) for i in sorted(seen) if (i >= split) is late]
            for late in (False, True)
        ]
        shares.append((accuracy(*pairs) + accuracy(*pairs[::-1])) / 2)
    by_phone, by_file = shares
    print(
        f"{first.stem} and {second.stem}: {len(seen)} pictures; accuracy "
        f"{100 * by_phone:.1f} % by phone, {100 * by_file:.1f} % from the recording"
    )


if __name__ == "__main__":
    measure(Path(sys.argv[1]), Path(sys.argv[2]))
