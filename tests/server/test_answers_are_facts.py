"""A change that the server reports as saved survives a kill, whichever call the disk refuses.

Each route that writes runs on a robot in virtual time, whose disk refuses one call, or all calls
from one on. When the answer arrives, the folder is copied, as a kill would leave it, and a new
start reads the copy. Unless the answer is a refusal or has `kept` false, the copy must be the same
as with a sound disk. A copy at any earlier call must have the content before or after the change.
cli/test_main.py tests commands on a full disk.
"""

import random
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

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
from tests.kit.disk import Disk
from tests.kit.sizes import few, size
from tests.robot.recordings.drives import record_drive

from .test_damaged_folder import running
from .virtual_server import VirtualServer

MANY = 10**6
CASES = size("DISK_CASES", 2, 24)
"""Number of calls that fail, one after the other, for each write; MANY means every call."""
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
def folder(tmp_path_factory):
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


def holds(root: Path, secrets: Sequence[str]) -> dict[str, Any]:
    """Return what the next start finds in a folder."""
    with running(root) as (rig, kept):
        history, pairing = rig.loop.history, Pairing(10, file=root / "paired.json")
        saved = ModelLibrary(kept.storage, kept.models).saved()
        return {
            "models": sorted((one.name, one.summary.place) for one in saved if one.summary),
            "in use": (kept.autosave.name, history.policy.name, dict(history.taught)),
            "images": [(one.votes, one.frames, one.is_pinned) for one in images(history.policy)],
            "episodes": sorted(
                (one.title, one.is_protected, one.edits, one.frames)
                for one in kept.part(Recordings).episodes.summaries()
                if one.frames  # the runs of these servers have no name
            ),
            "identity": IdentityFile(root).now,
            "sessions": [pairing.find(secret) is not None for secret in secrets],
        }


class Asked(NamedTuple):
    """The answer to a write, the folder as a kill would leave it, and the number of calls to the
    disk.

    If the test wants them, `copies` has a copy of the folder at each call.
    """

    answer: httpx.Response
    killed: Path
    secrets: tuple[str, str]
    calls: int
    copies: list[Path]


def ask(
    folder: Path,
    write: str,
    scratch: Path,
    *,
    first: int = MANY,
    lasts: bool = False,
    is_copied: bool = False,
) -> Asked:
    """Make one write on a disk whose `first` call fails, and perhaps all later ones."""
    root, copies = scratch / "data", list[Path]()
    shutil.copytree(folder, root)
    method, path, body = WRITES[write]
    pairing = Pairing(10, file=root / "paired.json")
    redeemed = pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
    with (
        pytest.MonkeyPatch.context() as patch,
        VirtualServer(pairing=pairing, data=root, name="bench") as server,
    ):
        kept = server.persistence
        kept.autosave.load_last()
        server.services.identity._path = root / "robot.json"
        server.set_mode(Mode.STOPPED)
        server.forward(1.0)
        episodes = kept.part(Recordings).episodes
        trashed = sorted(path.name for path in (root / "trash").iterdir() if path.name.isdigit())
        driven = next(one.id for one in episodes.summaries() if one.frames)
        is_restored = "{episode_key}" in str(body)
        known = {
            "node": str(images(server.rig.loop.history.policy)[0].node_id),
            "episode": driven,
            "model_key": trashed[0] if trashed else "",
            "episode_key": episodes.delete(driven).key or "" if is_restored else "",
            "token": pairing.tokens[Role.PILOT],
        }
        options: dict[str, Any] = {}
        if isinstance(body, bytes):
            options["content"] = kept.models.read_file("other")
        elif body is not None:
            options["json"] = {
                key: value.format(**known) if isinstance(value, str) else value
                for key, value in body.items()
            }
        name = cookie_name(server.services.gateway.config)
        options["headers"] = {"cookie": f"{name}={redeemed.secret}"}

        def copy() -> None:
            copies.append(scratch / f"copy {len(copies)}")
            shutil.copytree(root, copies[-1])

        disk = Disk(root)
        disk.install(patch.setattr)
        disk.lay_beneath(kept)
        disk.before_each = copy if is_copied else disk.before_each
        disk.fail(first - 1, lasts=lasts)
        url = server.address + path.format(**known)
        answer = httpx.request(method, url, timeout=10, verify=False, **options)
        disk.heal()
        shutil.copytree(root, scratch / "killed")
    given = answer.headers.get("set-cookie", "").split(";")[0].partition("=")[2]
    return Asked(answer, scratch / "killed", (redeemed.secret, given), disk.calls, copies)


def is_kept(answer: httpx.Response) -> bool:
    """True if the answer says that the change is done, and not that it is not saved."""
    return answer.is_success and answer.json().get("kept") is not False


def failures(calls: int) -> list[tuple[int, bool]]:
    """Return the first call and random ones, each with whether all later calls fail, too."""
    assert calls, "the request writes nothing"
    cases = [(first, always) for first in range(1, calls + 1) for always in (True, False)]
    return [cases[0], *random.Random(1).sample(cases[1:], min(CASES, len(cases)) - 1)]


@pytest.mark.parametrize("write", ["pin", "undo", *few(list(WRITES)[3:], 4)])
def test_a_change_that_was_answered_as_saved_is_never_lost(folder, tmp_path, write):
    sound = ask(folder, write, tmp_path / "sound")
    assert is_kept(sound.answer), sound.answer.text
    wanted = holds(sound.killed, sound.secrets)
    for first, lasts in failures(sound.calls):
        asked = ask(folder, write, tmp_path / f"{first} {lasts}", first=first, lasts=lasts)
        assert asked.answer.status_code in (200, 201, 404, 409, 422, 507), asked.answer.text
        if is_kept(asked.answer):
            held = holds(asked.killed, asked.secrets)
            assert held == wanted, f"call {first} failed, all later ones: {lasts}"


@pytest.mark.parametrize("write", few(list(WRITES), 5))
def test_a_kill_during_a_change_loses_nothing_that_was_there_before_or_is_there_after(
    folder, tmp_path, write
):
    asked = ask(folder, write, tmp_path / "asked", is_copied=True)
    after = holds(asked.killed, asked.secrets)
    first, *copies = asked.copies
    before = holds(first, asked.secrets)
    for copy in random.Random(1).sample(copies, min(CASES, len(copies))):
        for thing, held in holds(copy, asked.secrets).items():
            wanted = (before[thing], after[thing])
            if thing in ("models", "episodes"):  # the copy may have the changed item twice
                assert any(Counter(held) >= Counter(one) for one in wanted), (thing, copy.name)
            else:
                assert held in wanted, (thing, copy.name)
