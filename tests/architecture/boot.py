"""Starts the core once for each removed extension: `python boot.py FOLDER...`.

Each folder contains a tree without one extension. The process imports all libraries once. For each
tree, a child of this process then starts a server in memory, and prints the server's content as a
line of JSON.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from pathlib import Path


def main(folders: list[str]) -> int:
    import fastapi.testclient  # noqa: F401
    import numpy  # noqa: F401
    import uvicorn  # noqa: F401

    status = 0
    for folder in folders:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            try:
                print(json.dumps({"folder": folder, **start(Path(folder))}), flush=True)
            except BaseException:
                print(json.dumps({"folder": folder, "error": traceback.format_exc()}), flush=True)
                os._exit(1)
            os._exit(0)
        status |= os.waitpid(child, 0)[1]
    return bool(status)


def start(folder: Path) -> dict[str, object]:
    """Serve a fake robot with a tree's server; return its commands, paths and sentences."""
    sys.path.insert(0, str(folder))
    import contextlib
    import io

    from fastapi.testclient import TestClient

    from robot.camera import Camera
    from robot.clock import RealClock
    from robot.devices.plugins import default_driver, driver_names
    from robot.devices.rig import Rig
    from robot.driver import Driver, Sensors
    from robot.policy.registry import make_policy
    from robot.store.folder import Storage
    from robot.types import Action
    from server.app import create_app
    from server.cli.main import commands, main
    from server.config import Config
    from server.persistence import Persistence
    from server.services import Services

    class Body(Driver):
        name = default_camera = "none"
        is_connected = True

        def __init__(self) -> None: ...

        def connect(self) -> None: ...

        def disconnect(self) -> None: ...

        def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
            return action

        def sense(self) -> Sensors:
            return Sensors()

        def stop(self) -> None: ...

    class Blind(Camera):
        name = "none"

        @classmethod
        def for_driver(cls, driver: Driver, options: object, clock: RealClock) -> Blind:
            return cls(clock)

        def start(self) -> None: ...

        def stop(self) -> None: ...

    def says(*words: str) -> str:
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            status = main(words)
        return f"{status} {out.getvalue()}"

    clock, robot = RealClock(), next(iter(driver_names()), "none")
    rig = Rig(Body(), Blind(clock), make_policy("default-8"), clock)
    storage = Storage(folder / "data")
    os.environ["DRIVELESSON_DATA"] = str(storage.root)
    services = Services(
        Config(port=0, web=folder / "web"), rig, persistence=Persistence(storage, rig)
    )
    with TestClient(create_app(services), base_url="http://127.0.0.1") as client:
        paths = sorted(client.get("/openapi.json").json()["paths"])
    return {
        "commands": sorted(commands()),
        "paths": paths,
        "folders": sorted(path.name for path in storage.root.iterdir() if path.is_dir()),
        "unreachable": says("serve", "--host", "0.0.0.0", "--robot", robot),
        "no_robot": says("serve") if default_driver() is None else "",
        "modules": sorted(name for name in sys.modules if name.startswith(("robot.", "server."))),
    }


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
