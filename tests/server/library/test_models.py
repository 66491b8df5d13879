"""Models are renamed, copied, loaded and restored, in the data folder and over HTTP."""

import shutil
import unicodedata
from pathlib import Path

import httpx
import pytest

from robot.errors import ConfigurationError, NotFoundError
from robot.store.folder import Storage
from robot.store.models.model import same_nodes
from robot.store.models.recovery import recover
from robot.store.models.store import ModelStore
from robot.types import Action, Mode
from server.config import Config
from server.library.models import ModelLibrary
from tests.robot.store.models.test_model import some_model
from tests.robot.store.models.test_store import everything
from tests.server.live_robot import WEB
from tests.server.virtual_server import VirtualServer


@pytest.fixture
def store(tmp_path):
    times = iter(range(1000, 2000))
    return ModelStore(Storage(tmp_path), wall_s=lambda: float(next(times)))


@pytest.fixture
def library(tmp_path, store):
    store.save("kitchen", some_model())
    return ModelLibrary(Storage(tmp_path), store)


def test_rename_copy_delete_and_restore(store, library):
    store.current = "kitchen"
    assert library.rename("kitchen", " Küche ") == "Küche"
    assert store.current == "Küche"
    assert library.copy("Küche") == "Küche (2)"
    undo = store.delete("Küche")
    assert store.names() == ["Küche (2)"]
    store.save("KÜCHE", some_model())
    assert library.restore(undo) == "Küche (3)"
    assert store.names() == ["KÜCHE", "Küche (2)", "Küche (3)"]
    with pytest.raises(NotFoundError):
        library.restore(undo)
    with pytest.raises(NotFoundError):
        store.delete("cellar")


def test_names_that_differ_in_how_an_accent_is_written_are_one(store, library, tmp_path):
    (tmp_path / "models" / unicodedata.normalize("NFD", "Küche")).mkdir()
    assert store.free_name("küche") == "küche (2)"
    with pytest.raises(ConfigurationError, match="already"):
        library.rename("kitchen", "Küche")


# Over HTTP ---------------------------------------------------------------------------------------


class Bench:
    def __init__(self, server: VirtualServer, client: httpx.Client) -> None:
        self.server, self.client = server, client
        self.rig, self.persistence = server.rig, server.persistence

    def names(self) -> list[str]:
        return [model["name"] for model in self.client.get("/api/models").json()["models"]]


@pytest.fixture
def bench(tmp_path):
    config = Config(port=0, web=WEB, data=tmp_path)
    with (
        VirtualServer(config, data=tmp_path, name="bench") as server,
        httpx.Client(base_url=server.address) as client,
    ):
        server.wait_until(lambda: server.camera.latest() is not None)
        yield Bench(server, client)


def test_a_taught_model_is_saved_listed_and_previewed(bench):
    assert bench.client.get("/api/models").json() == {"current": None, "models": []}
    bench.server.teach(12)
    assert bench.client.post("/api/models/save").json() == {"name": "bench"}
    listed = bench.client.get("/api/models").json()
    assert listed["current"] == "bench"
    [model] = listed["models"]
    assert model["lessons"] == 12 and model["taught"] == {"left": 12}
    assert model["learner"] == "published-8" and model["current"] and model["readable"]
    preview = bench.client.get("/api/models/bench/preview")
    assert preview.content.startswith(b"\x89PNG")


def test_a_new_model_begins_like_earlier_models_of_its_learner_only(bench):
    bench.server.teach(3)  # the model of published-8, which has no linear part
    new = {"learner": "default-8", "name": "kitchen"}
    assert bench.client.post("/api/models", json=new).status_code == 201
    bench.server.teach(12)
    refused = bench.client.post("/api/models", json={"like": ["kitchen", "bench"]})
    assert refused.status_code == 409 and "default-8" in refused.json()["detail"]
    assert bench.client.get("/api/models").json()["current"] == "kitchen"
    begun = bench.client.post("/api/models", json={"name": "hall", "like": ["kitchen"]})
    assert begun.status_code == 201, begun.text
    state = bench.persistence.models.load("hall").state
    assert state.labels == [Action.LEFT] and state.arrays["linear"].any()


@pytest.mark.parametrize("ask", ["begin", "load"])
def test_a_full_disk_refuses_another_model_and_keeps_what_was_taught(bench, ask, monkeypatch):
    bench.server.teach(5)
    assert bench.client.post("/api/models/save").status_code == 200
    bench.server.teach(7)

    def refuse(name: str, model: object) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(bench.persistence.models, "save", refuse)
    path, body = {
        "begin": ("/api/models", {"name": "new"}),
        "load": ("/api/models/bench/load", {}),
    }[ask]
    answer = bench.client.post(path, json=body)
    assert answer.status_code == 507 and "No space left" in answer.json()["detail"]
    assert bench.server.ask_loop(lambda: bench.rig.loop.history.taught.total()) == 12
    monkeypatch.undo()
    assert bench.client.post(path, json=body).status_code in (200, 201)
    assert bench.client.post("/api/models/bench/load").status_code == 200
    assert bench.server.ask_loop(lambda: bench.rig.loop.history.taught.total()) in (5, 12)


def test_loading_restores_the_state_of_a_model_unless_the_robot_drives(bench):
    bench.server.teach(12)
    bench.client.post("/api/models/save")
    made = bench.client.post("/api/models", json={"name": "Flur", "place": "the hall"})
    assert (made.status_code, made.json()) == (201, {"name": "Flur", "kept": True})
    assert bench.server.ask_loop(lambda: bench.rig.loop.history.taught.total()) == 0
    bench.server.teach(3)
    assert bench.client.post("/api/models/bench/load").json() == {"name": "bench", "kept": True}
    assert bench.server.ask_loop(lambda: bench.rig.loop.history.taught.total()) == 12
    assert bench.client.post("/api/models/Flur/load").status_code == 200
    assert bench.server.ask_loop(lambda: bench.rig.loop.history.taught.total()) == 3
    bench.server.set_mode(Mode.TRAIN)
    answer = bench.client.post("/api/models/bench/load")
    assert answer.status_code == 409 and "stop the robot" in answer.json()["detail"]


def test_a_model_is_renamed_copied_deleted_and_restored_by_requests(bench):
    bench.server.teach(5)
    bench.client.post("/api/models/save")
    changed = bench.client.patch("/api/models/bench", json={"name": "Küche", "place": "home"})
    assert changed.json() == {"name": "Küche"}
    assert bench.client.post("/api/models/Küche/copy", json={}).json() == {"name": "Küche (2)"}
    undo = bench.client.delete("/api/models/Küche (2)").json()["undo"]
    assert bench.names() == ["Küche"]
    assert bench.client.post("/api/models/restore", json={"undo": undo}).status_code == 200
    change = {"name": "Küche (2)", "place": "elsewhere"}
    assert bench.client.patch("/api/models/Küche", json=change).status_code == 409
    models = bench.client.get("/api/models").json()["models"]
    assert {one["name"] for one in models} == {"Küche", "Küche (2)"}
    assert {one["place"] for one in models} == {"home"}, "a refused request changes nothing"


@pytest.mark.parametrize("is_deleted", [False, True])
def test_after_a_kill_a_model_has_the_name_that_it_was_given_last(bench, is_deleted):
    bench.server.teach(5)
    bench.client.post("/api/models/save")
    undone = bench.client.post("/api/teaching/undo", json={"seconds": 0.12})
    assert undone.status_code == 200, "only the journal contains this undo"
    bench.client.patch("/api/models/bench", json={"name": "Küche"})
    assert bench.client.patch("/api/models/bench", json={"name": "bench"}).status_code == 404
    if is_deleted:
        bench.client.delete("/api/models/Küche")
    store = bench.persistence.models
    recovered = recover(bench.persistence.storage.journal, store)
    assert recovered is not None
    assert recovered.name == (None if is_deleted else "Küche")


def test_download_and_upload(bench):
    bench.server.teach(5)
    bench.client.post("/api/models/save")
    file = bench.client.get("/api/models/bench/file")
    assert "attachment" in file.headers["content-disposition"]
    uploaded = bench.client.put("/api/models/bench/file", content=file.content)
    assert (uploaded.status_code, uploaded.json()) == (201, {"name": "bench (2)"})
    assert bench.client.get("/api/models/bench (2)/file").content == file.content


def test_what_cannot_be_done_changes_nothing(bench, tmp_path):
    """Each refusal has its status; tests/server/test_hostile_values.py tests other values."""
    bench.server.teach(5)
    bench.client.post("/api/models/save")
    before = everything(tmp_path)
    for method, path, body, status in (
        ("PUT", "/x/file", b"no model", 422),
        ("PUT", "/x/file", b"", 400),
        ("POST", "/nobody/load", b"", 404),
        ("GET", "/%2e%2e/file", b"", 404),
        ("POST", "", b'{"name": "../x"}', 409),
        ("PATCH", "/bench", b'{"name": "../x"}', 409),
        ("POST", "/bench/copy", b'{"name": "a/b"}', 409),
        ("POST", "", b'{"learner": "oracle-7"}', 409),
        ("POST", "", b'{"like": ["nobody"]}', 404),
        ("POST", "", b'{"like": ["a","a","a","a","a","a","a","a","a"]}', 409),
    ):
        answer = bench.client.request(method, f"/api/models{path}", content=body)
        assert answer.status_code == status, (path, answer.text)
    assert everything(tmp_path) == before


def test_a_mode_change_saves(bench):
    bench.server.teach(7)
    bench.server.set_mode(Mode.TRAIN)
    bench.persistence.autosave.stop()
    assert bench.names() == ["bench"]


def test_after_a_kill_examples_that_were_declared_outdated_still_are(bench, tmp_path):
    """The test copies the folder without its models when the answer arrives, so that no later save
    can help. tests/server/test_answers_are_facts.py tests other changes."""
    bench.server.use_policy("default-8")
    bench.server.teach(6)
    assert bench.client.post("/api/teaching/outdate").json()["kept"]
    left = Storage(tmp_path / "left")
    shutil.copytree(tmp_path / "journal", left.journal)
    now = bench.server.ask_loop(lambda: bench.rig.loop.history.policy.get_state())
    recovered = recover(left.journal, ModelStore(left))
    assert recovered is not None and same_nodes(recovered.model.state, now)
    assert recovered.model.state.params["learner"] == now.params["learner"]
