"""The routes of gallery, teaching and settings, on a bench robot."""

from base64 import b64decode
from dataclasses import replace
from typing import Any

import httpx
import pytest

from robot.coaching.trial_drive import CLEAN_S
from robot.types import Action, DrivenBy, Encoding, Mode
from server.coaching.extension import CoachingExtension

from .virtual_server import VirtualServer


@pytest.fixture
def taught(tmp_path):
    """A running robot that was taught 40 frames within four virtual seconds."""
    with VirtualServer(data=tmp_path) as server:
        teach_a_default_model(server)
        yield server


def teach_a_default_model(server: VirtualServer) -> None:
    labels = (Action.LEFT, *3 * [Action.FORWARD])
    server.teach(40, labels, every_s=0.1, policy="default-8")


def ask(server: VirtualServer, method: str, path: str, **options: Any) -> httpx.Response:
    # `verify=False` saves the reading of certificates, which takes longer than the request.
    return httpx.request(method, server.address + path, timeout=10, verify=False, **options)


def gallery(server: VirtualServer) -> dict[int, dict[str, Any]]:
    images = ask(server, "GET", "/api/gallery").json()["images"]
    for image in images:
        del image["last_used"]  # the timer continues while the robot drives
    return {image["node"]: image for image in images}


def test_the_gallery_lists_every_image_with_its_picture(taught):
    images = gallery(taught)
    assert len(images) == 8
    # If the view stays the same, only changes of the label are learned: two of four examples.
    assert sum(image["frames"] for image in images.values()) == 20
    assert {image["angle"] for image in images.values()} == {None}, "taught by moves only"
    picture = ask(taught, "GET", f"/api/gallery/{next(iter(images))}.png")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    assert ask(taught, "GET", "/api/gallery/999999.png").status_code == 404


def test_an_image_merged_before_it_was_listed_still_has_a_picture(taught):
    """The state names an image that no longer exists when the page requests it."""
    loop = taught.rig.loop

    taught.wait_until(lambda: getattr(loop.state.prediction, "node", None) is not None)
    node = loop.state.prediction.node
    taught.ask_loop(lambda: loop.history.edit("delete", node))
    assert ask(taught, "GET", f"/api/gallery/{node}.png").content.startswith(b"\x89PNG")


def test_an_image_is_relabelled_pinned_deleted_and_all_is_undone(taught):
    before = gallery(taught)
    node = next(iter(before))

    def edit(**body: Any) -> int:
        return ask(taught, "POST", f"/api/gallery/{node}", json=body).status_code

    assert edit(verb="relabel", value="right") == 200
    assert {k for k, n in gallery(taught)[node]["votes"].items() if n} == {"right"}
    assert edit(verb="pin", value=True) == 200
    assert gallery(taught)[node]["pinned"]
    assert edit(verb="delete") == 409, "a pinned image cannot be deleted"
    assert edit(verb="pin", value=False) == 200
    assert edit(verb="delete") == 200
    assert node not in gallery(taught)
    for _ in range(4):
        assert ask(taught, "POST", "/api/gallery/undo").json() == {"undone": True, "kept": True}
    assert gallery(taught) == before
    assert ask(taught, "POST", "/api/gallery/undo").json() == {"undone": False, "kept": True}


def test_a_change_of_mind_is_undone_like_an_edit_if_the_learner_supports_it(taught):
    assert ask(taught, "POST", "/api/teaching/outdate").json() == {"outdated": 40, "kept": True}
    assert ask(taught, "POST", "/api/gallery/undo").json() == {"undone": True, "kept": True}
    assert ask(taught, "POST", "/api/gallery/undo").json() == {"undone": False, "kept": True}
    taught.use_policy("published-8")
    answer = ask(taught, "POST", "/api/teaching/outdate")
    assert (answer.status_code, "new model" in answer.json()["detail"]) == (409, True)


def test_the_setting_of_symmetry_is_set_shown_and_withdrawn(taught):
    def word() -> dict[str, bool]:
        answer: dict[str, bool] = ask(taught, "GET", "/api/teaching/alike").json()
        return answer

    assert word()["possible"] and not word()["alike"]
    said = ask(taught, "POST", "/api/teaching/alike", json={"alike": True})
    assert said.json() == {**word(), "kept": True} and word()["alike"]
    assert ask(taught, "POST", "/api/gallery/undo").json() == {"undone": True, "kept": True}
    assert not word()["alike"]
    assert ask(taught, "POST", "/api/teaching/alike", json={"alike": "left"}).status_code == 400
    taught.use_policy("published-8")
    assert not word()["possible"]
    assert ask(taught, "POST", "/api/teaching/alike", json={"alike": True}).status_code == 409


@pytest.mark.parametrize(
    ("node", "body", "status"),
    [
        ("999999", {"verb": "delete"}, 404),
        ("", {"verb": "paint"}, 400),
        ("", {"verb": "relabel", "value": "fly"}, 409),
        ("", {"verb": "relabel", "value": "stop"}, 409),
        ("", {}, 400),
    ],
)
def test_a_bad_change_is_refused_with_a_sentence(taught, node, body, status):
    answer = ask(taught, "POST", f"/api/gallery/{node or next(iter(gallery(taught)))}", json=body)
    assert (answer.status_code, bool(answer.json()["detail"])) == (status, True)


def test_undo_shows_the_examples_and_removes_them(taught):
    last = ask(taught, "GET", "/api/teaching/last", params={"seconds": 1}).json()
    assert last["lessons"] == 10
    assert sum(last["taught"].values()) == 10
    assert [lesson["frame"] for lesson in last["strip"]] == list(range(1030, 1040))
    undone = ask(taught, "POST", "/api/teaching/undo", json={"seconds": 1}).json()
    assert undone == {"undone": 10, "kept": True}
    assert ask(taught, "GET", "/api/teaching").json()["lessons"] == 30


def test_settings_list_the_possible_values(taught):
    settings = ask(taught, "GET", "/api/settings").json()
    assert settings["learner"] == "default-8"
    rates = [size["rate_hz"] for size in settings["sizes"]]
    assert rates == sorted(rates, reverse=True)
    assert settings["camera"]["width"] == 160


def test_another_size_begins_anew_and_keeps_the_old_model(taught):
    answer = ask(taught, "PUT", "/api/settings", json={"max_nodes": 64, "speed": 0.5})
    assert answer.json() == {"learner": "default-64", "speed": 0.5, "kept": True}
    assert gallery(taught) == {}
    assert len(taught.persistence.models.names()) == 2


OTHERS = {"speed": 0.5, "name": "Ada", "max_nodes": 64}


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"speed": 0}, 400),
        ({"speed": 2}, 400),
        ({"max_nodes": 33}, 400),
        ({"moves": ["forward"]}, 409),
        ({"moves": ["forward", "fly"]}, 409),
        ({"moves": "forward"}, 400),
        ({"name": "a/b"}, 409),
        ({"colour": "red"}, 409),
    ],
)
def test_a_bad_setting_is_refused_and_no_other_changes_with_it(taught, body, status):
    for others in ({}, OTHERS):
        answer = ask(taught, "PUT", "/api/settings", json={**others, **body})
        assert answer.status_code == status
        now = ask(taught, "GET", "/api/settings").json()
        assert (now["speed"], now["name"], now["colour"]) == (1, "bench", "grey")
        assert len(gallery(taught)) == 8


def test_settings_that_start_a_new_model_are_refused_while_the_robot_drives(taught):
    taught.set_mode(Mode.AUTONOMOUS)
    assert ask(taught, "PUT", "/api/settings", json=OTHERS).status_code == 409
    now = ask(taught, "GET", "/api/settings").json()
    assert (now["speed"], now["name"]) == (1, "bench")


def test_readiness_says_what_is_missing(taught):
    told = ask(taught, "GET", "/api/teaching/readiness").json()
    assert told["stage"] == "teach"
    assert (told["alone_s"], told["alone_needed_s"]) == (0, CLEAN_S)
    assert set(told["moves"]) == {"forward", "left"}
    short = told["missing"][0]
    assert (short["kind"], short["png"]) == ("too_short", None)
    assert 0 < short["have"] < short["need"]


@pytest.mark.parametrize("is_tiny", [False, True], ids=["", "of one pixel"])
def test_readiness_shows_the_view_in_which_the_pilot_took_the_wheel(taught, is_tiny):
    lesson = taught.services.extension(CoachingExtension).progress.lesson
    ticks: list[Any] = []
    unsubscribe = taught.rig.loop.subscribe(lambda tick: ticks.append(tick) if tick.frame else None)
    taught.wait_until(lambda: bool(ticks))
    unsubscribe()
    by_robot = replace(ticks[0].decision, driven_by=DrivenBy.ROBOT)
    by_pilot = replace(by_robot, driven_by=DrivenBy.PILOT, action=Action.LEFT, mode=Mode.AUTONOMOUS)
    frame = ticks[0].frame
    if is_tiny:
        frame = replace(frame, encoding=Encoding.RGB, width=1, height=1, data=b"\x80" * 3)
    seen = [replace(ticks[0], frame=frame, decision=of) for of in (by_robot, by_pilot)]
    taught.ask_loop(lambda: [lesson.note(tick) for tick in seen])
    gaps = ask(taught, "GET", "/api/teaching/readiness").json()["missing"]
    [corrected] = [gap for gap in gaps if gap["kind"] == "corrected"]
    assert corrected["move"] == "left"
    assert b64decode(corrected["png"]).startswith(b"\x89PNG")
