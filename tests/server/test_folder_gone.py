"""The data folder disappears, like a stick that is pulled out: nothing is written below its
path."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from robot.store.folder import write_whole
from robot.store.presence import MARK, Presence
from server.access.pairing import Pairing
from server.gateway.roles import Role
from server.identity import IdentityFile
from tests.kit.sizes import size

from .test_damaged_folder import running, teach

MOMENTS = size("MOMENTS", 4, 30)


def pull(root: Path) -> Path:
    """Leave an empty folder at the path of the data folder, as below a mount point."""
    away = root.with_name("away")
    root.rename(away)
    root.mkdir()
    return away


def plug_in(root: Path, away: Path) -> None:
    root.rmdir()  # fails if anything was written there
    away.rename(root)


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_a_folder_that_disappears_during_teaching_loses_nothing(tmp_path: Path, seed: int) -> None:
    root, dice = tmp_path / "data", random.Random(seed)
    system = running(root)
    pairing, identity = Pairing(10, root / "paired.json"), IdentityFile(root)
    with system as (rig, persistence):
        for _ in range(dice.randrange(4)):
            teach(rig)
            rig.clock.sleep(dice.random() * 12.0)
        away = pull(root)
        learned = teach(rig)
        rig.clock.sleep(5.0)
        assert system.told.count("nothing_kept") == 1
        pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
        with pytest.raises(OSError, match="data folder is gone"):
            identity.change(name="another")
        with pytest.raises(OSError, match="data folder is gone"):
            persistence.autosave.save()
        rig.clock.sleep(dice.random() * 30.0)
        assert list(root.iterdir()) == []
        is_back = dice.random() < 0.5
        if is_back:
            plug_in(root, away)
            rig.clock.sleep(5.0)
            assert system.told.count("kept_again") == 1
            learned = teach(rig)
    if not is_back:
        assert list(root.iterdir()) == [], "nothing is written at the end, either"
        plug_in(root, away)
    with running(root) as (_, persistence):
        saved = [model.summary.n_examples for _, model in persistence.models.good_models()]
        assert max(saved) == learned if is_back else max(saved, default=0) <= learned


def test_a_folder_is_known_again_on_another_disk(tmp_path: Path) -> None:
    root = tmp_path / "data"
    root.mkdir()
    presence = Presence(root)
    away = pull(root)
    assert not presence.is_there()
    root.rmdir()
    root.mkdir()  # the same stick, with another device number
    (root / MARK).write_bytes((away / MARK).read_bytes())
    assert presence.is_there() and presence.is_there()


def test_only_paths_below_a_watched_folder_that_is_gone_are_refused(tmp_path: Path) -> None:
    root, other = tmp_path / "data", tmp_path / "other"
    root.mkdir()
    presence = Presence(root)
    presence.watch()
    try:
        pull(root)
        write_whole(other / "file", b"x")
        with pytest.raises(OSError, match="data folder is gone"):
            write_whole(root / "models/m/00001.npz", b"x")
    finally:
        presence.end_watch()
    write_whole(root / "models/m/00001.npz", b"x")
