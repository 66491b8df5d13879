"""Runs the v4l2 camera in a separate process, and reports its pictures in lines of JSON.

Any line on standard input ends it.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import threading
import time

from robot.bodies.v4l2.camera import UsbCameraOptions, V4l2Camera
from robot.clock import RealClock
from robot.errors import CameraError


def main() -> None:
    if hidden := sys.argv[3]:  # as if it were not installed
        find = importlib.util.find_spec
        importlib.util.find_spec = lambda name, *rest: None if name == hidden else find(name, *rest)
    options = UsbCameraOptions(device=sys.argv[1], encoding=sys.argv[2])
    camera = V4l2Camera(options, RealClock())
    lock = threading.Lock()

    def tell() -> None:
        frame, now_s = camera.latest(), time.monotonic()
        said = {"now_s": now_s, "fault": camera.fault}
        if frame is not None:
            said |= {
                "frame": frame.frame_id,
                "age_s": now_s - frame.captured_s,
                "size": [frame.width, frame.height, len(frame.data)],
                "encoding": frame.encoding,
                "first": frame.data[:6].hex(),
                "second_row": frame.data[320:326].hex(),
            }
        with lock:
            print(json.dumps(said), flush=True)

    camera.listen(tell)
    try:
        with camera:
            sys.stdin.readline()
    except CameraError as error:
        print(json.dumps({"error": str(error)}), flush=True)


if __name__ == "__main__":
    main()
