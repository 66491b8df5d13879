"""Generated drives in the formats of other programs: the files on the disk, and their true content.

Each maker writes one variant of a format into a folder and returns the truth: for each picture, by
the number drawn in it, the label that an import must give it (None: not an example). Variants
differ like programs and their users: in separators, paths, times, damage.
"""

from __future__ import annotations

import csv
import io
import json
import random
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.types import Action, Frame

Truth = dict[int, Action | None]
F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


@cache
def picture(number: int, ending: str = ".jpg") -> bytes:
    """A picture that shows its number by the brightness of nine areas, two bits each."""
    digits = [number >> 2 * place & 3 for place in range(9)]
    pixels = np.repeat(np.array(digits, np.uint8)[None, :] * 80, 8, axis=0).repeat(8, axis=1)
    done, data = cv2.imencode(ending, np.repeat(pixels[:, :, None], 3, axis=2))
    assert done
    return data.tobytes()


def number_of(frame: Frame) -> int:
    """Read a picture's number."""
    from robot.policy.image import to_rgb

    areas = to_rgb(frame)[:, :, 1].reshape(8, 9, 8).mean(axis=(0, 2))
    return sum(min(3, round(area / 80)) << 2 * place for place, area in enumerate(areas))


@dataclass
class Made:
    """One variant: its location, its true content, and a person's settings for it."""

    path: Path
    truth: Truth
    reading: dict[str, Any] = field(default_factory=dict)
    damaged: set[int] = field(default_factory=set)
    """Missing or broken pictures, which must not be imported."""


def drive(dice: random.Random, least: int = 12, most: int = 24) -> list[tuple[int, Action]]:
    """A drive of some pictures, with each label at least once."""
    count = dice.randint(least, most)
    labels = [F, L, R, *dice.choices([F, L, R], k=count - 3)]
    dice.shuffle(labels)
    return list(enumerate(labels))


def angle_of(dice: random.Random, label: Action, least: float = 0.25) -> float:
    if label is F:
        return round(dice.uniform(-0.15, 0.15), 3)
    side = round(dice.uniform(least, 1.0), 3)
    return side if label is R else -side


def spoil(dice: random.Random, folder: Path, names: dict[int, str]) -> set[int]:
    """Remove or damage a picture or two."""
    bad = set(dice.sample(sorted(names), k=dice.choice([0, 0, 1, 2])))
    for number in bad:
        path = folder / names[number]
        if dice.random() < 0.5:
            path.unlink()
        else:
            path.write_bytes(path.read_bytes()[:60])
    return bad


def put(folder: Path, name: str, number: int) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(picture(number, ".png" if name.endswith(".png") else ".jpg"))


def named_folders(dice: random.Random, home: Path) -> Made:
    """Folders named like moves, or classes mapped to moves; zips of a single class."""
    folder, truth = home / "lesson", {}
    is_mapped = dice.random() < 0.4
    classes = {F: "free", L: "blocked"} if is_mapped else {F: "forward", L: "left", R: "right"}
    if dice.random() < 0.3:
        classes = {move: name.upper().replace("_", " ") for move, name in classes.items()}
    for number, label in drive(dice):
        if label not in classes:
            continue
        stem = f"{dice.getrandbits(128):032x}" if is_mapped else str(number)
        put(folder, f"{classes[label]}/{stem}{dice.choice(['.jpg', '.jpeg', '.png'])}", number)
        truth[number] = label
    if dice.random() < 0.3:
        (folder / ".ipynb_checkpoints").mkdir()
        put(folder, ".ipynb_checkpoints/x.jpg", 999)
    moves = {"free": F, "blocked": L} if is_mapped else {}
    path = zipped(folder) if dice.random() < 0.3 else folder
    return Made(path, truth, {"moves": moves})


def zipped(folder: Path, name: str | None = None) -> Path:
    path = folder.with_name(name or f"{folder.name}.zip")
    with zipfile.ZipFile(path, "w") as archive:
        for each in sorted(folder.rglob("*")):
            archive.write(each, each.relative_to(folder))
    return path


def one_class(dice: random.Random, home: Path) -> Made:
    """Samples of Teachable Machine: one class, named by its zip."""
    label = dice.choice([F, L, R])
    name = dice.choice(
        [str(label), str(label).upper(), f"{label} (1)", f"{label}-samples", "Class 1"]
    )
    truth: Truth = {}
    for number in range(dice.randint(3, 12)):
        put(home / "samples", f"{number}.jpg", number)
        truth[number] = label
    path = zipped(home / "samples", f"{name}.zip")
    return Made(path, truth, {"moves": {"class_1": label}})


def project(dice: random.Random, home: Path) -> Made:
    """A project of Teachable Machine."""
    names = {F: "Class 1", L: "Left", R: "right"}
    truth: Truth = {}
    for number, label in drive(dice):
        put(home / "p", f"{names[label]}-!-{number}.jpg", number)
        truth[number] = label
    (home / "p/manifest.json").write_text(
        json.dumps(
            {"type": "image", "version": "2.4.10", "appdata": {"classes": [*names.values()]}}
        )
    )
    return Made(zipped(home / "p", "lesson.tm"), truth, {"moves": {"class_1": F}})


def table(dice: random.Random, home: Path) -> Made:
    """A table of pictures, with columns of any known name in any order, and any separator."""
    folder, truth = home / "set", {}
    kind = dice.choice(["label", "steering", "wheels", "velocity", "numbers"])
    place = dice.choice(["images/", "", "a/b/"])
    said = dice.choice(["", "/home/x/set/", "C:\\Users\\x\\set\\", ".\\", "./"])
    separator = dice.choice([",", ",", ";", "\t"])
    full = dice.choice([1.0, 100.0, 255.0])
    lock = dice.choice([1.0, 1.0, 25.0])
    stamp = dice.choice(["none", "s", "ms", "ns", "date"])
    names: dict[int, str] = {}
    rows: list[dict[str, str]] = []
    reading: dict[str, Any] = {}
    headers = {
        "picture": dice.choice(
            ["file", "Image", "filename", "file_name", "cam/image_array", "path"]
        ),
        "label": dice.choice(["label", "Move", "action"]),
        "angle": dice.choice(["angle", "Steering", "steering_angle", "user/angle"]),
        "throttle": dice.choice(["throttle", "user/throttle"]),
        "time": {"s": "time_s", "ms": "time_ms", "ns": "timestamp[ns]"}.get(stamp, "timestamp"),
    }
    has_throttle = dice.random() < 0.5
    classes = {F: "0", L: "1", R: "2"}
    for number, label in drive(dice):
        name = f"{place}img_{number}.{dice.choice(['jpg', 'png'])}"
        put(folder, name, number)
        names[number] = name
        row = {headers["picture"]: said + (name.replace("/", "\\") if "\\" in said else name)}
        truth[number] = label
        angle = angle_of(dice, label)
        if kind == "label":
            row[headers["label"]] = dice.choice([str(label), str(label).upper()])
        elif kind == "numbers":
            row[headers["label"]] = classes[label]
        elif kind == "steering":
            row[headers["angle"]] = f"{angle * lock:.4f}"
            if has_throttle:
                stands = dice.random() < 0.15
                row[headers["throttle"]] = "0.0" if stands else "0.4"
                truth[number] = None if stands else label
        elif kind == "wheels":
            outer, inner = 0.8, 0.8 if label is F else dice.uniform(0.0, 0.5)
            left, right = (inner, outer) if label is L else (outer, inner)
            row |= {"left_wheel": f"{full * left:.3f}", "right_wheel": f"{full * right:.3f}"}
        else:
            row |= {"linear.x": "0.25", "angular.z": f"{-0.7 * angle:.4f}"}
        at_s = 1.7e9 + 0.1 * number
        row |= {
            "none": {},
            "date": {headers["time"]: str(datetime.fromtimestamp(at_s, UTC).replace(tzinfo=None))},
        }.get(stamp, {headers["time"]: repr(at_s * {"s": 1, "ms": 1e3, "ns": 1e9}.get(stamp, 1))})
        rows.append(row)
    if kind == "numbers":
        reading["moves"] = {"0": F, "1": L, "2": R}
    if kind == "steering":
        reading["full_lock"] = lock
    columns = list(rows[0])
    dice.shuffle(columns)
    ending = "\r\n" if dice.random() < 0.3 else "\n"
    text = io.StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator=ending)
    writer.writerow(columns)
    decimal = "," if separator == ";" and dice.random() < 0.5 else "."
    for row in rows:
        cells = [row[name] for name in columns]
        if decimal == ",":
            cells = [
                c.replace(".", ",") if c.replace(".", "").lstrip("-").isdigit() else c
                for c in cells
            ]
        writer.writerow(cells)
    bom = "\ufeff" if dice.random() < 0.2 else ""
    (folder / dice.choice(["data.csv", "metadata.csv", "LABELS.CSV"])).write_text(
        bom + text.getvalue(), encoding="utf-8", newline=""
    )
    return Made(folder, truth, reading, spoil(dice, folder, names))


def udacity(dice: random.Random, home: Path) -> Made:
    """A log of Udacity's simulator, with or without a header line, from another computer."""
    folder, truth = home / "data", {}
    disk = dice.choice(["", "IMG/", "/home/me/sim/IMG/", "C:\\Users\\me\\Desktop\\IMG\\"])
    names: dict[int, str] = {}
    lines = []
    for number, label in drive(dice):
        stamp = datetime.fromtimestamp(1.7e9 + 0.1 * number, UTC)
        tail = f"{stamp:%Y_%m_%d_%H_%M_%S}_{stamp.microsecond // 1000:03d}.jpg"
        names[number] = f"IMG/center_{tail}"
        put(folder, names[number], number)
        for side, wrong in (("left", 100), ("right", 200)):
            put(folder, f"IMG/{side}_{tail}", wrong + number)
        stands, coasts = dice.random() < 0.15, dice.random() < 0.3
        throttle = 0 if stands or coasts else dice.choice([0.3, 1])
        speed = f"{dice.uniform(0, 1e-4):.6E}" if stands else f"{dice.uniform(3, 30):.5f}"
        truth[number] = None if stands else label
        three = dice.choice([", ", ","]).join(
            f"{disk}{side}_{tail}" for side in ("center", "left", "right")
        )
        lines.append(f"{three},{angle_of(dice, label)},{throttle},0,{speed}")
    head = ["center,left,right,steering,throttle,brake,speed"] if dice.random() < 0.5 else []
    (folder / "driving_log.csv").write_text("\n".join([*head, *lines, ""]))
    return Made(folder, truth, {}, spoil(dice, folder, names))


def course(dice: random.Random, home: Path) -> Made:
    """A log of a robot-car course: no header line, and times in the names without final zeros."""
    folder, truth = home / "DataCollected", {}
    lines, names = [], {}
    trim = dice.choice([0.0, 0.0, -0.13])
    for number, label in drive(dice):
        stamp = str(1.7e9 + 0.05 * number + dice.choice([0, 0.001, 0.000123])).replace(".", "")
        names[number] = f"IMG0/Image_{stamp}.jpg"
        put(folder, names[number], number)
        share = angle_of(dice, label, 0.3)
        angle = trim + share * (1 - trim if share > 0 else 1 + trim)
        lines.append(f"C:\\Users\\me\\DataCollected\\IMG0\\Image_{stamp}.jpg,{angle:.3f}")
        truth[number] = label
    (folder / "log_0.csv").write_text("\n".join([*lines, ""]))
    return Made(folder, truth, {"trim": trim}, spoil(dice, folder, names))


def steered_names(dice: random.Random, home: Path) -> Made:
    """Pictures whose names contain the steering; the dash is a minus sign or a separator."""
    folder, truth = home / "frames", {}
    form = dice.choice(["{:06d}{:.2f}", "{:06d}-{:.2f}", "{:06d}{:+.2f}", "{:06d}_{:.2f}"])
    for number, label in drive(dice):
        put(folder, form.format(number, angle_of(dice, label)) + ".jpg", number)
        truth[number] = label
    return Made(folder, truth)


def openbot(dice: random.Random, home: Path) -> Made:
    """A session of OpenBot, by its own logs or by its notebook's table."""
    folder, truth = home / "session", {}
    frames = ["timestamp[ns],frame"]
    controls = ["timestamp[ns],leftCtrl,rightCtrl"]
    matched = ["timestamp (frame),time_offset (cmd-frame),frame,left,right,cmd"]
    matched = ["timestamp,frame,left,right,cmd"] if dice.random() < 0.5 else matched[:1]
    is_raw, at, last = dice.random() < 0.6, 10**18, None
    names: dict[int, str] = {}
    for number, label in drive(dice):
        at += dice.randint(25, 60) * 10**6
        names[number] = f"images/{number}_crop.jpeg"
        put(folder, names[number], number)
        fast, slow = dice.randint(150, 255), dice.randint(0, 90)
        left, right = {F: (fast, fast), L: (slow, fast), R: (fast, slow)}[label]
        if label is not last:
            controls.append(f"{at - 10**6},{left},{right}")
        frames.append(f"{at},{number}")
        matched.append(f"{at},/home/me/session/{names[number]},{left},{right},0")
        truth[number], last = label, label
    ending = dice.choice(["\n", "\r\n"])
    logs = folder / "sensor_data"
    logs.mkdir()
    files = {"rgbFrames.txt": frames, "ctrlLog.txt": controls}
    if not is_raw:
        files = {"matched_frame_ctrl_cmd_processed.txt": matched}
    for name, lines in files.items():
        (logs / name).write_text(ending.join([*lines, ""]), newline="")
    bad = spoil(dice, folder, names)
    return Made(zipped(folder) if dice.random() < 0.3 else folder, truth, {}, bad)


def tub_of_version_1(dice: random.Random, home: Path) -> Made:
    """A tub of version 1, with any of its three times, missing pictures, and other drivers."""
    folder, truth = home / "tub", {}
    clock = dice.choice(["milliseconds", "timestamp", "none"])
    names: dict[int, str] = {}
    for number, label in drive(dice):
        names[number] = f"{number}_cam-image_array_.jpg"
        put(folder, names[number], number)
        mode = dice.choice(["user", "user", "user", "local"])
        record = {
            "cam/image_array": names[number],
            "user/angle": angle_of(dice, label),
            "user/throttle": 0.3,
            "user/mode": mode,
        }
        if clock == "milliseconds":
            record[clock] = 50 * number
        elif clock == "timestamp":
            record[clock] = str(
                datetime.fromtimestamp(1.5e9 + 0.05 * number, UTC).replace(tzinfo=None)
            )
        (folder / f"record_{number}.json").write_text(json.dumps(record))
        truth[number] = label if mode == "user" else None
    put(folder, "9999_cam-image_array_.jpg", 999)
    return Made(folder, truth, {}, spoil(dice, folder, names))


MAKERS: dict[str, Callable[[random.Random, Path], Made]] = {
    make.__name__: make
    for make in (
        *(named_folders, one_class, project, table, udacity, course, steered_names, openbot),
        tub_of_version_1,
    )
}


def ros_bag(dice: random.Random, home: Path) -> Made:
    """A bag of ROS 1 or 2, written by `rosbags`: pictures in their order, and velocities that
    hold."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    is_first, truth = dice.random() < 0.4, {}
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    types = store.types
    raw, is_stamped = dice.choice(["", "", "rgb8", "bgr8", "mono8"]), dice.random() < 0.4

    def header(at_ns: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=at_ns // 10**9, nanosec=at_ns % 10**9)
        more = {"seq": 0} if is_first else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **more)

    def image(number: int, at_ns: int) -> tuple[str, Any]:
        if not raw:
            kind = "sensor_msgs/msg/CompressedImage"
            data = np.frombuffer(picture(number), np.uint8)
            return kind, types[kind](header=header(at_ns), format="jpeg", data=data)
        pixels = cv2.imdecode(np.frombuffer(picture(number, ".png"), np.uint8), cv2.IMREAD_COLOR)
        pixels = pixels[:, :, 0] if raw == "mono8" else pixels[:, :, :: -1 if raw == "rgb8" else 1]
        kind, channels = "sensor_msgs/msg/Image", 1 if raw == "mono8" else 3
        return kind, types[kind](
            header=header(at_ns),
            height=8,
            width=72,
            encoding=raw,
            is_bigendian=0,
            step=72 * channels,
            data=np.ascontiguousarray(pixels).reshape(-1),
        )

    def order(label: Action, at_ns: int) -> tuple[str, Any]:
        vector = types["geometry_msgs/msg/Vector3"]
        turn = -0.7 * angle_of(dice, label)
        linear = vector(x=dice.uniform(0.1, 0.6), y=0.0, z=0.0)
        twist = types["geometry_msgs/msg/Twist"](
            linear=linear, angular=vector(x=0.0, y=0.0, z=turn)
        )
        if not is_stamped:
            return "geometry_msgs/msg/Twist", twist
        kind = "geometry_msgs/msg/TwistStamped"
        return kind, types[kind](header=header(at_ns), twist=twist)

    at_ns, last, messages = 1_700_000_000 * 10**9, None, []
    for number, label in drive(dice):
        at_ns += dice.randint(30, 90) * 10**6
        if number == 0 and dice.random() < 0.3:
            truth[500] = None  # there was no command yet
            messages.append(("/camera/image", at_ns - 2 * 10**6, *image(500, at_ns)))
        if label is not last or dice.random() < 0.5:
            messages.append(("/cmd_vel", at_ns - 10**6, *order(label, at_ns)))
        messages.append(("/camera/image", at_ns, *image(number, at_ns)))
        truth[number], last = label, label
    path = home / ("drive.bag" if is_first else "drive")
    plugin = dice.choice([StoragePlugin.SQLITE3, StoragePlugin.MCAP])
    writer: Any = Writer1(path) if is_first else Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store)
            for topic, kind in {topic: kind for topic, _, kind, _ in messages}.items()
        }
        for topic, at, kind, message in messages:
            write = store.serialize_ros1 if is_first else store.serialize_cdr
            writer.write(connections[topic], at, write(message, kind))
    if not is_first and dice.random() < 0.5:
        path = next(each for each in path.iterdir() if each.suffix in (".db3", ".mcap"))
    return Made(path, truth)


def lerobot_rover(dice: random.Random, home: Path) -> Made:
    """A dataset with the actions of LeKiwi, EarthRover or a gamepad's car, and a depth camera."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder, truth, rows = home / "set", {}, []
    body = dice.choice(["lekiwi", "earthrover", "car"])
    names: Any = {
        "lekiwi": ["arm_gripper.pos", "x.vel", "y.vel", "theta.vel"],
        "earthrover": ["linear_velocity", "angular_velocity"],
        "car": {"throttle": 1, "steering": 0},
    }[body]
    for number, label in drive(dice):
        angle = angle_of(dice, label)
        stands = dice.random() < 0.1
        action = {
            "lekiwi": [50.0, 0.0 if stands else 0.2, 0.0, 0.0 if stands else -60 * angle],
            "earthrover": [0.0 if stands else 1.0, 0.0 if stands else -angle],
            "car": [angle, 0.0 if stands else 0.4],
        }[body]
        truth[number] = None if stands else label
        near, far = ({"bytes": picture(n), "path": None} for n in (number, 300 + number))
        row = {"action": action, "timestamp": number / 10, "frame_index": number}
        rows.append({**row, "episode_index": 0, "front_depth": far, "wrist": near})
    shape = {"dtype": "image", "shape": [8, 72, 3], "names": ["height", "width", "channels"]}
    flag = dice.choice(["is_depth_map", "video.is_depth_map"])
    features = {
        "front_depth": {**shape, "info": {flag: True}},
        "wrist": shape,
        "action": {"dtype": "float32", "shape": [len(names)], "names": names},
    }
    info = {"codebase_version": "v3.0", "fps": 10, "robot_type": body, "features": features}
    for path in (folder / "meta", folder / "data/chunk-000"):
        path.mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    pq.write_table(pa.Table.from_pylist(rows), folder / "data/chunk-000/file-000.parquet")
    return Made(folder, truth)


MAKERS |= {"ros_bag": ros_bag, "lerobot_rover": lerobot_rover}
