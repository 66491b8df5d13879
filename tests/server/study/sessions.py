"""The actions of researcher and participant in a session, over HTTP and in virtual time."""

import csv
import io
import zipfile
from typing import Any

from robot.driver import Sensors
from robot.types import Mode
from tests.server.test_teaching_routes import ask, teach_a_default_model
from tests.server.virtual_server import VirtualServer

PLAN = """
title = "Two times"
participants = 2
world = "kitchen"
moves = ["forward", "left"]
learner = "published-8"
consent = { en = "You may stop.", es = "Puede parar." }
questionnaires = ["trust"]
[[phase]]
kind = "teach"
seconds = 2
[[phase]]
kind = "alone"
seconds = 1
[[condition]]
name = "short"
[[condition]]
name = "long"
seconds = { teach = 3 }
"""
TRUST = {"trust_confident": 3, "trust_reliable": 4, "trust_can_trust": 5}


def post(server: VirtualServer, path: str, **body: Any) -> Any:
    answer = ask(server, "POST", path, json=body)
    assert answer.status_code in (200, 201), answer.text
    return answer.json()


def refused(server: VirtualServer, path: str, **body: Any) -> str:
    answer = ask(server, "POST", path, json=body)
    assert answer.status_code == 409, answer.text
    return str(answer.json()["detail"])


def session(server: VirtualServer) -> Any:
    return ask(server, "GET", "/api/session").json()["session"]


def begin(server: VirtualServer, code: str = "P01") -> None:
    if "walk" not in ask(server, "GET", "/api/studies").json()["studies"]:
        post(server, "/api/studies", name="walk", plan=PLAN)
    post(server, "/api/session", study="walk", participant=code)
    if session(server)["step"] == "consent":
        post(server, "/api/session/consent", language="es")


def drive(server: VirtualServer, seconds: float | None = None) -> None:
    """Drive in the mode of each phase, for some seconds or until the questions come."""
    server.driver.sensors = Sensors(distance_m=0.8)
    pilot = server.pilot()
    now = session(server)
    while now["mode"] is not None:
        pilot.mode(now["mode"])
        pilot.hold("forward" if now["mode"] == "train" else None)
        pilot.wait_for_state(mode=now["mode"])
        if seconds is not None:
            server.forward(seconds)
            break
        for _ in range(40):
            server.forward(0.25)
            if server.rig.loop.mode is Mode.STOPPED:
                break
        now = session(server)
    pilot.close()


def answer(server: VirtualServer) -> None:
    post(server, "/api/session/answers", answers=TRUST, done=True)


def take_part(server: VirtualServer, code: str) -> None:
    begin(server, code)
    while session(server)["step"] != "done":
        post(server, "/api/session/drive", confirmed=True)
        drive(server)
        answer(server)
    ask(server, "DELETE", "/api/session")


def rows(server: VirtualServer) -> list[dict[str, str]]:
    data = ask(server, "GET", "/api/studies/walk/zip").content
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return list(csv.DictReader(io.StringIO(archive.read("phases.csv").decode())))


def standing(server: VirtualServer) -> tuple[Any, ...]:
    """Return the model in use, the robot's models, and the exact state of its learner."""
    models = ask(server, "GET", "/api/models").json()
    state = server.ask_loop(lambda: server.rig.loop.history.policy.get_state())
    arrays = {name: array.tobytes() for name, array in state.arrays.items()}
    moves = server.rig.loop.history.policy.moves
    return models["current"], sorted(m["name"] for m in models["models"]), arrays, moves


def prepare(server: VirtualServer) -> tuple[Any, ...]:
    """Teach the robot, outside a session, something for its own model."""
    teach_a_default_model(server)
    ask(server, "POST", "/api/models/save", json={})
    return standing(server)
