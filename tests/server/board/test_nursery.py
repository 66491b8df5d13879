"""Robots that are forked from one process end separately, or all together with the class."""

import os
import re
import signal
import sys
from urllib.request import urlopen

import pytest

pytest.importorskip("panda3d")

from server.board.class_key import keep_class_key
from server.board.nursery import Nursery
from tests.kit.wait import wait_until

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks"),
]


OPTIONS = """
def configure(parser):
    parser.add_argument("--brightness", type=float, default=0.5)
"""
EXTENSION = """
from server.services import Extension

class Lamp(Extension):
    def __init__(self, services, options):
        self.brightness = options["brightness"]
"""
PLUGIN = {
    "lamp/__init__.py": "",
    "lamp/options.py": OPTIONS,
    "lamp/extension.py": EXTENSION,
    "lamp-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: lamp\nVersion: 1\n",
    "lamp-1.dist-info/entry_points.txt": "[drivelesson.services]\nlamp = lamp.extension:Lamp\n",
}
"""A plugin that reads an option of its own."""


def test_each_robot_can_end_separately_and_all_end_with_the_class(tmp_path, monkeypatch):
    for name, text in PLUGIN.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    nursery = Nursery(tmp_path, "box")
    assert nursery.picture_s is not None and 0 < nursery.picture_s < 1

    mistaken = nursery.start(["--robot", "nobody"], tmp_path / "log.txt")
    assert mistaken is not None and mistaken.wait()
    assert "unknown robot 'nobody'" in (tmp_path / "log.txt").read_text()

    keep_class_key(tmp_path / "class.key")
    common = ["--lan", "--host", "127.0.0.1", "--port", "0", "--no-page"]
    common += ["--class-key", str(tmp_path / "class.key"), "--data"]
    log = tmp_path / "two.txt"
    killed, stays = (
        nursery.start([*common, str(tmp_path / name)], tmp_path / f"{name}.txt")
        for name in ("one", "two")
    )
    assert killed is not None and stays is not None
    _, pid, other = nursery._ended
    os.kill(pid, signal.SIGKILL)
    assert killed.wait() and not stays.is_set()

    wait_until(lambda: log.exists() and "To watch" in log.read_text(), "the robot serves", 60)
    address = re.findall(r"http://127.0.0.1:\d+", log.read_text())[0]
    with urlopen(address + "/healthz", timeout=60) as answer:
        assert answer.status == 200
    nursery.end()
    nursery.wait()
    assert stays.wait()
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)
