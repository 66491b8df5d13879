"""Whatever value a stored file has (NaN, text instead of a number, 1e400), no request gets 5xx.

Every JSON file of a used folder is damaged in turn, and also the JSON texts inside models.
"""

import io
import json
import random
import re
import shutil
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.store.folder import Storage
from server.access.config import NetworkLimits
from server.access.pairing import Pairing
from server.config import Config
from server.identity import IdentityFile
from tests.kit.described import readable_addresses
from tests.kit.sizes import size
from tests.robot.recordings.drives import record_drive

from .study.sessions import PLAN, answer, begin, drive, post, take_part
from .virtual_server import WEB, VirtualServer

SEEDS = size("DAMAGE", 4, 100)
VALUES = (
    "NaN", "Infinity", "-Infinity", "1e400", "-1", "0", "9" * 400, "null", "true", '""', '"x"',
    '"\\ud83d"', '"' + "y" * 9000 + '"', "[]", "{}", "[" * 500 + "]" * 500, '{"a": NaN}', "[NaN]",
    '"../../x"', '"\\u0000"', "1.5",
)  # fmt: skip
_VALUE = re.compile(rb'(?<=[:\[,])\s*("(?:[^"\\]|\\.)*"|-?\d[\d.eE+-]*|true|false|null)')


def served(root: Path) -> VirtualServer:
    limits = NetworkLimits(requests_per_second=1e6, requests_burst=1e6)
    return VirtualServer(Config(port=0, web=WEB, data=root, limits=limits), data=root)


@pytest.fixture(scope="module")
def lively(tmp_path_factory):
    """A folder with a study, a finished and an unfinished session, edits and a trash."""
    root = tmp_path_factory.mktemp("lively") / "data"
    episode = record_drive(Storage(root).folder("episodes"), frames=20).id
    gone = record_drive(Storage(root).folder("episodes"), frames=5).id
    Pairing(10, file=root / "paired.json").redeem("x", 0.0)
    (root / "paired.json").write_text('{"sessions": [{"sha256": "ab", "role": "pilot"}]}')
    IdentityFile(root).change(name="Ada")
    (root / "class.json").write_text('{"locks": ["models"]}')
    (root / "lessons").mkdir()
    (root / "lessons" / "20260101-120000-trial-1.json").write_text(
        '{"trial": 1, "started": "2026-01-01T12:00:00", "seconds": {"teach": 60.0}, "ssd": 0.5}'
    )
    with served(root) as server, httpx.Client(base_url=server.address, timeout=60) as client:
        post(server, "/api/studies", name="walk", plan=PLAN)
        take_part(server, "P01")
        client.post(
            f"/api/episodes/{episode}/edits", json={"verb": "exclude", "first": 1, "last": 2}
        )
        client.patch(f"/api/episodes/{episode}", json={"title": "t"})
        client.delete(f"/api/episodes/{gone}")
        client.post("/api/models/save", json={})
        begin(server, "P02")
        post(server, "/api/session/drive", confirmed=True)
        drive(server)
        answer(server)
    kinds = {path.relative_to(root).parts[0] for path in stored(root)}
    assert kinds >= {"models", "studies", "lessons", "robot.json", "paired.json", "class.json"}
    assert list((root / "episodes").glob("*.edits.json"))
    return root


def damage(data: bytes, dice: random.Random) -> bytes:
    """Replace one value by another."""
    places = list(_VALUE.finditer(data))
    if not places:
        return data
    place, value = dice.choice(places), dice.choice(VALUES).encode()
    return data[: place.start(1)] + value + data[place.end(1) :]


def damage_file(path: Path, dice: random.Random) -> None:
    if path.suffix != ".npz":
        path.write_bytes(damage(path.read_bytes(), dice))
        return
    out = io.BytesIO()
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(out, "w") as damaged:
        for name in archive.namelist():
            whole = archive.read(name)
            head, brace, text = whole.partition(b'{"')
            is_text = name == "meta.npy" and brace
            damaged.writestr(name, head + damage(brace + text, dice) if is_text else whole)
    path.write_bytes(out.getvalue())


def stored(root: Path) -> list[Path]:
    """Return every file that is JSON or contains JSON text."""
    kinds = (".json", ".jsonl", ".npz")
    return sorted(path for path in root.rglob("*") if path.suffix in kinds and path.is_file())


@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_stored_value_makes_an_address_fail(lively, tmp_path, seed):
    dice = random.Random(seed)
    root = tmp_path / "data"
    shutil.copytree(lively, root)
    files = stored(root)
    for path in {files[seed % len(files)], dice.choice(files)}:
        for _ in range(dice.randrange(1, 4)):
            damage_file(path, dice)
    Pairing(10, file=root / "paired.json")
    IdentityFile(root)
    failed: dict[str, Any] = {}
    seen: list[str] = []
    with served(root) as server, httpx.Client(base_url=server.address, timeout=60) as client:
        for address in readable_addresses(client, "walk", "P01"):
            answer = client.get(address)
            if answer.status_code >= 500:
                failed[address] = answer.text[:200]
            elif answer.headers.get("content-type", "").startswith("application/json"):
                json.loads(answer.text, parse_constant=seen.append)
                if seen:  # no browser can read this number
                    failed[address] = seen.pop()
    assert not failed, [str(path.relative_to(root)) for path in files[seed % len(files) :][:1]]
