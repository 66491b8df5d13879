"""Runs in LeRobot's environment: uses an export as LeRobot's users do, and makes a dataset."""

from __future__ import annotations

import sys
from pathlib import Path

import lerobot
import numpy as np
import torch
from lerobot.datasets.dataset_tools import delete_episodes, merge_datasets, split_dataset
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.utils.feature_utils import hw_to_dataset_features

export, other, plain, out = map(Path, sys.argv[1:])
CAMERA = "observation.images.front"
print("VERSION", lerobot.__version__)


def opened(root: Path, name: str = "me/robot", **options: object) -> LeRobotDataset:
    return LeRobotDataset(name, root=root, video_backend="pyav", **options)


print("TRY loads, with delta_timestamps and a loader")
given = opened(export, delta_timestamps={"action": [0.0, 0.05, 0.1]})
batches = list(torch.utils.data.DataLoader(given, batch_size=32))
assert sum(len(batch["action"]) for batch in batches) == len(given) == given.meta.total_frames
assert batches[0][CAMERA].shape[1:] == (3, 120, 160) and batches[0]["action"].shape[1:] == (3, 2)
assert {"q01", "q50", "q99"} <= set(given.meta.stats["action"])
print("PASSED", f": {len(given)} frames")

print("TRY edits: deletes an episode")
kept = delete_episodes(opened(export), [0], output_dir=out / "kept", repo_id="me/kept")
assert kept.meta.total_episodes == 1 and len(kept) == len(given) // 2
assert kept[0][CAMERA].shape == (3, 120, 160)
print("PASSED")

print("TRY edits: splits")
parts = split_dataset(opened(export), {"train": [0], "val": [1]}, output_dir=out / "split")
assert sum(len(part) for part in parts.values()) == len(given)
print("PASSED")

print("TRY merges two different lessons")
lessons = [opened(export), opened(other)]
both = merge_datasets(lessons, "me/both", output_dir=out / "both")
assert len(both) == sum(map(len, lessons)) and both.meta.total_episodes > 2
assert both[len(both) - 1][CAMERA].shape == (3, 120, 160)
print("PASSED", f": {len(both)} frames")

print("TRY records the robot of the docs")
floats = ("steering.pos", "throttle.vel")
features = {
    **hw_to_dataset_features(dict.fromkeys(floats, float), "action"),
    **hw_to_dataset_features(
        {"front": (120, 160, 3), **dict.fromkeys(floats, float)}, "observation"
    ),
}
own = LeRobotDataset.create(
    "me/own", fps=20, features=features, root=out / "own", robot_type="drivelesson"
)
for episode in range(2):
    for n in range(20):
        picture = np.full((120, 160, 3), 10 * n, np.uint8)
        action = np.array([(-1.0, 0.0, 1.0)[n % 3], 0.5], np.float32)
        shown = {CAMERA: picture, "observation.state": action}
        own.add_frame({**shown, "action": action, "task": f"drive {episode}"})
    own.save_episode()
own.finalize()
print("PASSED")

print("TRY merges a plain export with that recording")
given = [opened(plain), opened(out / "own", "me/own")]
driven = merge_datasets(given, "me/driven", output_dir=out / "driven")
assert len(driven) == sum(map(len, given))
assert driven[len(driven) - 1][CAMERA].shape == (3, 120, 160)
print("PASSED", f": {len(driven)} frames")
