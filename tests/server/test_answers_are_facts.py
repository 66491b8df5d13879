"""A change that was answered as done and saved survives a kill, whichever call the disk refuses.

Each route that writes runs on a robot in virtual time. Its disk refuses one call, or all calls from
one on. The folder is copied when the answer arrives, as a kill would leave it, and a new start
reads the copy. Unless the answer is a refusal or has `kept` false, the copy must contain what it
contains with a sound disk. Commands on a full disk: cli/test_full_disk.py.
"""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.coaching.gallery import images
from robot.store.folder import Storage
from robot.types import Mode
from server.access.pairing import Pairing, cookie_name
from server.gateway.roles import Role
from server.identity import IdentityFile
from server.library.models import ModelLibrary
from server.recordings.part import Recordings
from tests.client.disk import Disk
from tests.kit.sizes import few, size
from tests.robot.recordings.drives import record_drive

from .test_damaged_folder import running
from .virtual_server import VirtualServer

MANY = 10**6
CASES = size("DISK_CASES", 2, 24)
"""Number of disk failures that each write is tested with; with MANY, each call in turn."""
EPISODE = "/api/episodes/{episode}"
WRITES: dict[str, tuple[str, str, Any]] = {
    "pin": ("POST", "/api/gallery/{node}", {"verb": "pin", "value": True}),
    "relabel": ("POST", "/api/gallery/{node}", {"verb": "relabel", "value": "right"}),
    "delete an image": ("POST", "/api/gallery/{node}", {"verb": "delete"}),
    "undo": ("POST", "/api/teaching/undo", {"seconds": 1}),
    "save": ("POST", "/api/models/save", None),
    "begin": ("POST", "/api/models", {"name": "new", "place": "there"}),
    "load": ("POST", "/api/models/other/load", None),
    "rename": ("PATCH", "/api/models/bench", {"name": "renamed"}),
    "rename another": ("PATCH", "/api/models/other", {"name": "renamed"}),
    "place": ("PATCH", "/api/models/other", {"place": "somewhere"}),
    "copy": ("POST", "/api/models/other/copy", {"name": "third"}),
    "delete a model": ("DELETE", "/api/models/other", None),
    "restore a model": ("POST", "/api/models/restore", {"undo": "{model_key}"}),
    "upload": ("PUT", "/api/models/uploaded/file", b"{model}"),
    "size": ("PUT", "/api/settings", {"max_nodes": 16}),
    "name": ("PUT", "/api/settings", {"name": "Wren", "colour": "teal"}),
    "title": ("PATCH", EPISODE, {"title": "a title", "protected": True}),
    "edit": ("POST", EPISODE + "/edits", {"verb": "delete", "first": 2, "last": 4}),
    "compact": ("POST", EPISODE + "/compact", None),
    "split": ("POST", EPISODE + "/split", {"frame": 8}),
    "delete an episode": ("DELETE", EPISODE, None),
    "restore an episode": ("POST", "/api/episodes/restore", {"undo": "{episode_key}"}),
    "unpair": ("POST", "/api/unpair", None),
    "pair": ("POST", "/api/pair", {"token": "{token}"}),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with two models, a recording, and a model in the trash."""
    root = tmp_path_factory.mktemp("facts") / "data"
    with VirtualServer(data=root, name="bench") as server:
        server.teach(12, server.rig.loop.state.moves[:2], every_s=0.1)
        server.persistence.autosave.save()
        models = server.persistence.models
        for name in ("other", "gone"):
            models.add_file(name, models.read_file("bench"))
        models.delete("gone")
        server.forward(1.0)
    IdentityFile(root, "bench")
    record_drive(Storage(root).folder("episodes"), "published-8", frames=16)
    return root


def holds(root: Path) -> dict[str, Any]:
    """Return what the next start finds in a folder."""
    with running(root) as (rig, persistence):
        models = {
            saved.name: (saved.summary.place, saved.summary.n_examples, saved.summary.learner)
            for saved in ModelLibrary(persistence.storage, persistence.models).saved()
            if saved.summary is not None
        }
        part = persistence.part(Recordings)
        episodes = sorted(
            (one.title, one.is_protected, one.edits, one.frames)
            for one in part.episodes.summaries()
            if one.frames  # the runs of these servers have no name
        )
        history = rig.loop.history
        return {
            "models": models,
            "episodes": episodes,
            "in use": (persistence.autosave.name, history.policy.name, dict(history.taught)),
            "images": [
                (image.votes, image.frames, image.is_pinned) for image in images(history.policy)
            ],
            "identity": IdentityFile(root).now,
            "sessions": len(Pairing(10, file=root / "paired.json")._sessions),
        }


def ask(
    folder: Path, write: str, first: int, *, for_ever: bool, scratch: Path
) -> tuple[httpx.Response, Path, int]:
    """Make one write on a failing disk; return the answer, the folder after a kill, and the
    calls."""
    root = scratch / "data"
    shutil.copytree(folder, root)
    method, path, body = WRITES[write]
    pairing = Pairing(10, file=root / "paired.json")
    secret: Any = pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
    with (
        pytest.MonkeyPatch.context() as patch,
        VirtualServer(data=root, name="bench", pairing=pairing) as server,
    ):
        kept = server.persistence
        kept.autosave.load_last()
        server.services.identity._path = root / "robot.json"
        server.set_mode(Mode.STOPPED)
        server.forward(1.0)
        episodes = kept.part(Recordings).episodes
        trashed = sorted(path.name for path in (root / "trash").iterdir() if path.name.isdigit())
        driven = next(one.id for one in episodes.summaries() if one.frames)
        known = {
            "node": str(images(server.rig.loop.history.policy)[0].node_id),
            "episode": driven,
            "model_key": trashed[0] if trashed else "",
            "episode_key": episodes.delete(driven).key or ""
            if "{episode_key}" in str(body)
            else "",
            "token": pairing.tokens[Role.PILOT],
        }
        disk = Disk(root)
        disk.install(patch.setattr)
        if (writer := kept.writer._writer) is not None:
            writer._files = disk.lay_beneath(writer._files)
        options: dict[str, Any] = {}
        if isinstance(body, bytes):
            options["content"] = kept.models.read_file("other")
        elif body is not None:
            options["json"] = {
                key: value.format(**known) if isinstance(value, str) else value
                for key, value in body.items()
            }
        cookie = {"cookie": f"{cookie_name(server.services.gateway.config)}={secret.secret}"}
        disk.fail(first - 1 if first else MANY, lasts=for_ever)
        url = server.address + path.format(**known)
        answer = httpx.request(method, url, headers=cookie, timeout=10, verify=False, **options)
        disk.heal()
        shutil.copytree(root, scratch / "killed")
    return answer, scratch / "killed", disk.calls


def is_kept(answer: httpx.Response) -> bool:
    """True if the answer says that the change is done, and not that it is not saved."""
    return answer.is_success and answer.json().get("kept") is not False


def failures(calls: int) -> list[tuple[int, bool]]:
    """Return which call fails, and whether all later ones fail too: the first call, and random
    ones."""
    assert calls, "it writes something"
    cases = [(first, always) for first in range(1, calls + 1) for always in (True, False)]
    return [cases[0], *random.Random(1).sample(cases[1:], min(CASES, len(cases)) - 1)]


@pytest.mark.parametrize("write", ["pin", "undo", *few(list(WRITES)[3:], 4)])
def test_a_change_that_was_answered_as_saved_is_never_lost(
    folder: Path, tmp_path: Path, write: str
) -> None:
    def make(first: int, *, for_ever: bool) -> Any:
        scratch = tmp_path / f"{first} {for_ever}"
        scratch.mkdir()
        return ask(folder, write, first, for_ever=for_ever, scratch=scratch)

    answer, killed, calls = make(0, for_ever=False)
    assert is_kept(answer), answer.text
    wanted = holds(killed)
    for first, always in failures(calls):
        answer, killed, _ = make(first, for_ever=always)
        assert answer.status_code in (200, 201, 404, 409, 422, 507), answer.text
        if is_kept(answer):
            assert holds(killed) == wanted, f"call {first} failed, all later ones: {always}"
