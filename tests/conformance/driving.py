"""Tests LeRobot's commands with two served robots: a pilot drives one, and LeRobot drives the
other."""

from __future__ import annotations

import itertools
import os
import re
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from robot.exchange.lerobot import write_lerobot
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from tests.kit.served import Served, served
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot

from .samples import Samples, imports_of

_PATIENCE_S = 600
_TRAINING = (
    "--policy.type=act --policy.push_to_hub=false --policy.pretrained_backbone_weights=null "
    "--policy.chunk_size=4 --policy.n_action_steps=4 --policy.dim_model=64 --policy.n_heads=2 "
    "--policy.dim_feedforward=64 --policy.n_encoder_layers=1 --policy.use_vae=false "
    "--policy.device=cpu --dataset.video_backend=pyav --steps=3 --save_freq=3 --batch_size=2 "
    "--num_workers=0 --wandb.enable=false --dataset.repo_id=me/all"
)
_MERGE = """
import sys
from pathlib import Path
from lerobot.datasets.dataset_tools import merge_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset
*parts, out = map(Path, sys.argv[1:])
merge_datasets([LeRobotDataset(f"me/{p.name}", root=p) for p in parts], "me/all", output_dir=out)
"""
Tried = tuple[str, Callable[[], str]]


def taught(address: str) -> int:
    """Return a robot's number of examples, which grows while a pilot drives the robot."""
    text = httpx.get(f"{address}/metrics").text
    found = re.search(r'learner_seconds_count\{work="learn"\} (\d+)', text)
    return int(found[1]) if found else 0


def tries(python: Path, out: Path, samples: Samples) -> Iterator[Tried]:
    """Yield the tests, in order; each returns a report for people, or fails."""
    with (
        served(out / "led") as led,
        served(out / "followed") as followed,
        _pilot(led),
    ):
        leader, follower = led.address, followed.address
        robot = f"--robot.type=drivelesson --robot.address={follower} --robot.id=follower"
        robot += " --robot.restarts=true"
        page = f"--teleop.type=drivelesson_page --teleop.address={leader} --teleop.id=leader"

        def drives(name: str, words: str) -> str:
            before = taught(follower)
            _run(python, "-m", f"lerobot.scripts.{name}", *words.split())
            moves = taught(follower) - before
            assert moves > 5, f"the robot was driven on {moves} pictures"
            return f"drove on {moves} pictures"

        driven, merged, trained = out / "driven", out / "merged", out / "trained"
        recording = (
            f"--dataset.repo_id=me/driven --dataset.root={driven} --dataset.num_episodes=1 "
            "--dataset.episode_time_s=6 --dataset.reset_time_s=0 --dataset.fps=10 "
            "--dataset.push_to_hub=false --play_sounds=false --dataset.single_task=drive"
        )
        yield "lerobot-record", lambda: drives("lerobot_record", f"{robot} {page} {recording}")
        yield "its recording comes in", lambda: imports_of(driven)

        def merge() -> str:
            parts = [driven]
            for recording in (samples.recording, samples.lesson):
                parts.append(out / f"plain-{len(parts)}")
                write_lerobot([(open_episode(recording), Notes())], parts[-1], fps=10, plain=True)
            _run(python, "-c", _MERGE, *parts, merged)
            apart, together = imports_of(*parts), imports_of(merged)
            assert apart == together, (apart, together)
            return together

        yield "merges with two lessons, and comes back", merge
        replay = f"--dataset.repo_id=me/driven --dataset.root={driven} --dataset.episode=0"
        replay += " --play_sounds=false"
        yield "lerobot-replay", lambda: drives("lerobot_replay", f"{robot} {replay}")
        teleoperate = f"{robot} {page} --fps=10 --teleop_time_s=5"
        yield "lerobot-teleoperate", lambda: drives("lerobot_teleoperate", teleoperate)

        def train() -> str:
            words = f"{_TRAINING} --dataset.root={merged} --output_dir={trained}".split()
            _run(python, "-m", "lerobot.scripts.lerobot_train", *words)
            return ""

        yield "lerobot-train on all three, three steps of ACT", train
        policy = trained / "checkpoints" / "last" / "pretrained_model"
        rollout = f"--policy.path={policy} --policy.device=cpu --duration=5 --task=drive --fps=10"
        yield "lerobot-rollout", lambda: drives("lerobot_rollout", f"{rollout} {robot}")
    yield "the policy as a learner", lambda: _drive_as_learner(python, out / "alone", policy)


def _run(python: Path, *words: object) -> None:
    """Run a command of LeRobot, which must succeed."""
    done = subprocess.run(
        list(map(str, (python, *words))),
        capture_output=True,
        text=True,
        timeout=_PATIENCE_S,
        env={**os.environ, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"},
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-300:])


@contextmanager
def _pilot(server: Served) -> Iterator[None]:
    """Drive a robot with a pilot's client that has no screen."""
    ending = threading.Event()
    with Pilot(server.drive_url, sees=True) as pilot:
        pilot.wait_for_state_with(lambda state: state["frame"] is not None)

        def drive() -> None:
            for held in itertools.cycle(("forward", "left", "forward", "right")):
                pilot.hold(held)
                if pilot.state["mode"] != "train":
                    pilot.mode("train")
                if ending.wait(1.0):
                    return

        thread = threading.Thread(target=drive, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ending.set()
            thread.join(10)


def _drive_as_learner(python: Path, folder: Path, policy: Path) -> str:
    """Let a policy that LeRobot trained drive by itself."""
    environ = {"DRIVELESSON_LEROBOT_POLICY": str(policy), "HF_HUB_OFFLINE": "1"}
    with (
        served(folder, "--learner", "lerobot", python=python, **environ) as server,
        Pilot(server.drive_url, sees=True) as pilot,
    ):
        pilot.wait_for_state_with(lambda state: state["prediction"] is not None)

        def drives_itself() -> bool:
            if pilot.state["mode"] != "autonomous":
                pilot.mode("autonomous")
                time.sleep(0.2)
            return pilot.state["driven_by"] == "robot" and pilot.state["action"] != "stop"

        wait_until(drives_itself, what="the policy drives")
        return f"goes {pilot.state['action']}"
