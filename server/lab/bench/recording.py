"""What recording costs the control loop: its rate and turns with it and without."""

from __future__ import annotations

import argparse
import resource
import statistics
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from robot.clock import Clock, RealClock
from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.errors import need
from robot.policy.registry import make_policy
from robot.store.episodes.queue import RecorderConfig
from robot.store.episodes.recorder import Recorder
from robot.store.table import Cell, Table
from robot.testing import FakeCamera, FakeDriver
from robot.types import Action, Encoding, Frame, Mode, PilotCommand
from server.cli.parser import number, whole
from server.lab.bench.report import add_json, report

_COMMAND_EVERY_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One run: pictures seen a second, milliseconds a turn with a new picture, what it wrote.

    `cpu_ms` is what the loop's own thread computed for each picture: unlike the others it hardly
    depends on what else the machine does.
    """

    pictures: str
    recording: bool
    rate_hz: float
    turn_ms: float
    turn_p99_ms: float
    cpu_ms: float
    written_mb_s: float
    dropped: int


class PhotoCamera(FakeCamera):
    """Noisy pictures, which compress as little as a real room's; JPEG or raw."""

    def __init__(self, clock: Clock, rate_hz: float, width: int, height: int, jpeg: bool) -> None:
        super().__init__(clock, rate_hz, width, height)
        noise = np.random.default_rng(1).normal(0, 6, (height, width, 3))
        self._shots = []
        for data in self._pictures:
            picture = np.frombuffer(data, np.uint8).reshape(height, width, 3)
            noisy = np.clip(picture + noise, 0, 255).astype(np.uint8)
            self._shots.append(_to_jpeg(noisy) if jpeg else noisy.tobytes())
        self.encoding = Encoding.JPEG if jpeg else Encoding.RGB

    def take(self) -> Frame:
        return self._publish(
            self._shots[self._last_frame_id % len(self._shots)],
            width=self.width,
            height=self.height,
            encoding=self.encoding,
            captured_s=self.clock.now_s(),
        )


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seconds", type=number(above=0), default=8.0, help="of each run (%(default)s)"
    )
    parser.add_argument("--repeats", type=whole(1), default=3, help="runs of a kind (%(default)s)")
    parser.add_argument(
        "--rate", type=number(above=0), default=30.0, help="pictures a second (%(default)s)"
    )
    parser.add_argument("--size", default="640x480", help="of a picture (%(default)s)")
    parser.add_argument("--learner", default="default-32", help="what learns (%(default)s)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    width, height = (int(side) for side in args.size.split("x"))
    outcomes = []
    for jpeg in (True, False):
        for _ in range(args.repeats):
            for records in (False, True):
                camera = PhotoCamera(RealClock(), args.rate, width, height, jpeg)
                outcomes.append(measure(camera, args.learner, args.seconds, records=records))
                print(outcomes[-1], file=sys.stderr)
    return report(args, [asdict(outcome) for outcome in outcomes], _table(outcomes))


def measure(camera: PhotoCamera, learner: str, seconds: float, *, records: bool) -> Outcome:
    """Teach for some seconds, recorded or not."""
    turns_s: list[float] = []
    cpu_s: list[float] = []

    def note(tick: Tick) -> None:
        if tick.frame is not None:
            turns_s.append(tick.cycle_s)
        cpu_s.append(time.thread_time())

    rig = Rig(FakeDriver(), camera, make_policy(learner), camera.clock)
    with tempfile.TemporaryDirectory() as folder, rig:
        recorder = Recorder(rig.loop, Path(folder), config=RecorderConfig(spare_bytes=0))
        if records:
            recorder.start()
        rig.loop.set_mode(Mode.TRAIN).result(5)
        _hold(rig, 1.0)
        rig.loop.subscribe(note)
        started_s = time.monotonic()
        _hold(rig, seconds)
        took_s = time.monotonic() - started_s
        seen = list(turns_s)
        recorder.stop()
        written = sum(path.stat().st_size for path in Path(folder).iterdir())
    return Outcome(
        pictures="JPEG" if camera.encoding is Encoding.JPEG else "raw",
        recording=records,
        rate_hz=len(seen) / took_s,
        turn_ms=statistics.fmean(seen) * 1000,
        turn_p99_ms=float(np.percentile(seen, 99)) * 1000,
        cpu_ms=(cpu_s[-1] - cpu_s[0]) / len(seen) * 1000,
        written_mb_s=written / 1e6 / (took_s + 1.0),
        dropped=recorder.dropped_frames,
    )


def _hold(rig: Rig, seconds: float) -> None:
    """Hold one direction after the other, as a page does, ten words a second."""
    pause = threading.Event()
    ends_s = rig.clock.now_s() + seconds
    while (now_s := rig.clock.now_s()) < ends_s:
        held = (Action.FORWARD, Action.LEFT, Action.RIGHT)[int(now_s) % 3]
        rig.loop.command(
            PilotCommand(
                held=held,
                frame_id=rig.loop.state.frame_id,
                seq=int(now_s * 1000),
                received_s=now_s,
            )
        )
        pause.wait(_COMMAND_EVERY_S)


def _table(outcomes: list[Outcome]) -> Table:
    """Return the medians of the runs of a kind, and what recording changes."""
    rows: list[tuple[Cell, ...]] = []
    for pictures in ("JPEG", "raw"):
        medians: dict[bool, dict[str, float]] = {}
        for records in (False, True):
            runs = [o for o in outcomes if (o.pictures, o.recording) == (pictures, records)]
            medians[records] = own = {
                name: statistics.median(getattr(o, name) for o in runs)
                for name in ("rate_hz", "turn_ms", "turn_p99_ms", "cpu_ms", "written_mb_s")
            }
            lost: tuple[Cell, ...] = (None, None)
            if records:
                without = medians[False]
                share = (own["cpu_ms"] - without["cpu_ms"]) / 1000 * without["rate_hz"]
                lost = (f"{1 - own['rate_hz'] / without['rate_hz']:.2%}", f"{share:.2%}")
            dropped = sum(o.dropped for o in runs)
            rows.append((pictures, "yes" if records else "no", *own.values(), dropped, *lost))
    columns = (
        *("pictures", "recorded", "rate, Hz", "turn, ms", "p99, ms", "CPU, ms", "MB/s"),
        *("dropped", "rate lost", "CPU/period"),
    )
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    note = f"\npeak memory of the process: {peak_mb:.0f} MB"
    return Table(title="What recording costs", columns=columns, rows=tuple(rows), note=note)


def _to_jpeg(picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bytes:
    cv2 = need("cv2", "the benchmark of recording", "camera")
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])[1])
