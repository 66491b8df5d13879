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
    truth: Truth = field(default_factory=dict)
    reading: dict[str, Any] = field(default_factory=dict)
    damaged: set[int] = field(default_factory=set)
    """Missing or broken pictures, which must not be imported."""
    names: dict[int, str] = field(default_factory=dict)

    def add(self, name: str, number: int, label: Action | None) -> None:
        """Write a picture, which an import must give this label."""
        put(self.path, name, number)
        self.names[number], self.truth[number] = name, label

    def write(self, name: str, *lines: str, ending: str = "\n") -> None:
        path = self.path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(ending.join([*lines, ""]), encoding="utf-8", newline="")

    def spoil(self, dice: random.Random) -> Made:
        """Remove or damage a picture or two."""
        self.damaged = set(dice.sample(sorted(self.names), k=dice.choice([0, 0, 1, 2])))
        for number in self.damaged:
            path = self.path / self.names[number]
            if dice.random() < 0.5:
                path.unlink()
            else:
                path.write_bytes(path.read_bytes()[:60])
        return self

    def zipped(self, name: str | None = None) -> Made:
        folder, self.path = self.path, self.path.with_name(name or f"{self.path.name}.zip")
        with zipfile.ZipFile(self.path, "w") as archive:
            for each in sorted(folder.rglob("*")):
                archive.write(each, each.relative_to(folder))
        return self


def drive(dice: random.Random) -> list[tuple[int, Action]]:
    """A drive of 12 to 24 pictures, with each label at least once."""
    labels = [F, L, R, *dice.choices([F, L, R], k=dice.randint(9, 21))]
    dice.shuffle(labels)
    return list(enumerate(labels))


def angle_of(dice: random.Random, label: Action, least: float = 0.25) -> float:
    if label is F:
        return round(dice.uniform(-0.15, 0.15), 3)
    side = round(dice.uniform(least, 1.0), 3)
    return side if label is R else -side


def put(folder: Path, name: str, number: int) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(picture(number, ".png" if name.endswith(".png") else ".jpg"))


def named_folders(dice: random.Random, home: Path) -> Made:
    """Folders named like moves, or classes mapped to moves; zips of a single class."""
    made, is_mapped = Made(home / "lesson"), dice.random() < 0.4
    classes = {F: "free", L: "blocked"} if is_mapped else {F: "forward", L: "left", R: "right"}
    made.reading = {"moves": {"free": F, "blocked": L} if is_mapped else {}}
    if dice.random() < 0.3:
        classes = {move: name.upper() for move, name in classes.items()}
    for number, label in drive(dice):
        if label in classes:
            stem = f"{dice.getrandbits(128):032x}" if is_mapped else str(number)
            ending = dice.choice([".jpg", ".jpeg", ".png"])
            made.add(f"{classes[label]}/{stem}{ending}", number, label)
    if dice.random() < 0.3:
        put(made.path, ".ipynb_checkpoints/x.jpg", 999)
    return made.zipped() if dice.random() < 0.3 else made


def one_class(dice: random.Random, home: Path) -> Made:
    """Samples of Teachable Machine: one class, named by its zip."""
    label = dice.choice([F, L, R])
    names = [str(label), str(label).upper(), f"{label} (1)", f"{label}-samples", "Class 1"]
    made = Made(home / "samples", reading={"moves": {"class_1": label}})
    for number in range(dice.randint(3, 12)):
        made.add(f"{number}.jpg", number, label)
    return made.zipped(f"{dice.choice(names)}.zip")


def project(dice: random.Random, home: Path) -> Made:
    """A project of Teachable Machine."""
    names = {F: "Class 1", L: "Left", R: "right"}
    made = Made(home / "p", reading={"moves": {"class_1": F}})
    for number, label in drive(dice):
        made.add(f"{names[label]}-!-{number}.jpg", number, label)
    about = {"type": "image", "version": "2.4.10", "appdata": {"classes": [*names.values()]}}
    made.write("manifest.json", json.dumps(about))
    return made.zipped("lesson.tm")


def table(dice: random.Random, home: Path) -> Made:
    """A table of pictures, with columns of any known name in any order, and any separator."""
    made, rows = Made(home / "set"), list[dict[str, str]]()
    kind = dice.choice(["label", "steering", "wheels", "velocity", "numbers"])
    place = dice.choice(["images/", "", "a/b/"])
    said = dice.choice(["", "/home/x/set/", "C:\\Users\\x\\set\\", ".\\", "./"])
    separator = dice.choice([",", ",", ";", "\t"])
    full, lock = dice.choice([1.0, 100.0, 255.0]), dice.choice([1.0, 1.0, 25.0])
    stamp = dice.choice(["none", "s", "ms", "ns", "date"])
    pictures = ["file", "Image", "filename", "file_name", "cam/image_array", "path"]
    headers = {
        "picture": dice.choice(pictures),
        "label": dice.choice(["label", "Move", "action"]),
        "angle": dice.choice(["angle", "Steering", "steering_angle", "user/angle"]),
        "throttle": dice.choice(["throttle", "user/throttle"]),
        "time": {"s": "time_s", "ms": "time_ms", "ns": "timestamp[ns]"}.get(stamp, "timestamp"),
    }
    has_throttle, classes = dice.random() < 0.5, {F: "0", L: "1", R: "2"}
    for number, label in drive(dice):
        name = f"{place}img_{number}.{dice.choice(['jpg', 'png'])}"
        stands = kind == "steering" and has_throttle and dice.random() < 0.15
        made.add(name, number, None if stands else label)
        row = {headers["picture"]: said + (name.replace("/", "\\") if "\\" in said else name)}
        angle = angle_of(dice, label)
        if kind == "label":
            row[headers["label"]] = dice.choice([str(label), str(label).upper()])
        elif kind == "numbers":
            row[headers["label"]] = classes[label]
        elif kind == "steering":
            row[headers["angle"]] = f"{angle * lock:.4f}"
            row |= {headers["throttle"]: "0.0" if stands else "0.4"} if has_throttle else {}
        elif kind == "wheels":
            outer, inner = 0.8, 0.8 if label is F else dice.uniform(0.0, 0.5)
            left, right = (inner, outer) if label is L else (outer, inner)
            row |= {"left_wheel": f"{full * left:.3f}", "right_wheel": f"{full * right:.3f}"}
        else:
            row |= {"linear.x": "0.25", "angular.z": f"{-0.7 * angle:.4f}"}
        at_s = 1.7e9 + 0.1 * number
        if stamp == "date":
            row[headers["time"]] = str(datetime.fromtimestamp(at_s, UTC).replace(tzinfo=None))
        elif stamp != "none":
            row[headers["time"]] = repr(at_s * {"s": 1, "ms": 1e3, "ns": 1e9}[stamp])
        rows.append(row)
    made.reading = {"moves": {"0": F, "1": L, "2": R}} if kind == "numbers" else {}
    made.reading |= {"full_lock": lock} if kind == "steering" else {}
    columns = list(rows[0])
    dice.shuffle(columns)
    if separator == ";" and dice.random() < 0.5:
        rows = [{name: decimal_comma(cell) for name, cell in row.items()} for row in rows]
    text = io.StringIO(newline="")
    ending = "\r\n" if dice.random() < 0.3 else "\n"
    writer = csv.DictWriter(text, columns, delimiter=separator, lineterminator=ending)
    writer.writeheader()
    writer.writerows(rows)
    bom = "\ufeff" if dice.random() < 0.2 else ""
    name = dice.choice(["data.csv", "metadata.csv", "LABELS.CSV"])
    made.write(name, bom + text.getvalue().removesuffix(ending), ending=ending)
    return made.spoil(dice)


def decimal_comma(cell: str) -> str:
    is_number = cell.replace(".", "").lstrip("-").isdigit()
    return cell.replace(".", ",") if is_number else cell


def udacity(dice: random.Random, home: Path) -> Made:
    """A log of Udacity's simulator, with or without a header line, from another computer."""
    disk = dice.choice(["", "IMG/", "/home/me/sim/IMG/", "C:\\Users\\me\\Desktop\\IMG\\"])
    made, lines = Made(home / "data"), []
    for number, label in drive(dice):
        stamp = datetime.fromtimestamp(1.7e9 + 0.1 * number, UTC)
        tail = f"{stamp:%Y_%m_%d_%H_%M_%S}_{stamp.microsecond // 1000:03d}.jpg"
        stands, coasts = dice.random() < 0.15, dice.random() < 0.3
        made.add(f"IMG/center_{tail}", number, None if stands else label)
        for side, wrong in (("left", 100), ("right", 200)):
            put(made.path, f"IMG/{side}_{tail}", wrong + number)
        throttle = 0 if stands or coasts else dice.choice([0.3, 1])
        speed = f"{dice.uniform(0, 1e-4):.6E}" if stands else f"{dice.uniform(3, 30):.5f}"
        three = (f"{disk}{side}_{tail}" for side in ("center", "left", "right"))
        cells = [*three, angle_of(dice, label), throttle, 0, speed]
        lines.append(dice.choice([", ", ","]).join(map(str, cells)))
    head = ["center,left,right,steering,throttle,brake,speed"] if dice.random() < 0.5 else []
    made.write("driving_log.csv", *head, *lines)
    return made.spoil(dice)


def course(dice: random.Random, home: Path) -> Made:
    """A log of a robot-car course: no header line, and times in the names without final zeros."""
    trim = dice.choice([0.0, 0.0, -0.13])
    made, lines = Made(home / "DataCollected", reading={"trim": trim}), []
    for number, label in drive(dice):
        stamp = str(1.7e9 + 0.05 * number + dice.choice([0, 0.001, 0.000123])).replace(".", "")
        made.add(f"IMG0/Image_{stamp}.jpg", number, label)
        share = angle_of(dice, label, 0.3)
        angle = trim + share * (1 - trim if share > 0 else 1 + trim)
        lines.append(f"C:\\Users\\me\\DataCollected\\IMG0\\Image_{stamp}.jpg,{angle:.3f}")
    made.write("log_0.csv", *lines)
    return made.spoil(dice)


def steered_names(dice: random.Random, home: Path) -> Made:
    """Pictures whose names contain the steering; the dash is a minus sign or a separator."""
    made = Made(home / "frames")
    form = dice.choice(["{:06d}{:.2f}", "{:06d}-{:.2f}", "{:06d}{:+.2f}", "{:06d}_{:.2f}"])
    for number, label in drive(dice):
        made.add(form.format(number, angle_of(dice, label)) + ".jpg", number, label)
    return made


def openbot(dice: random.Random, home: Path) -> Made:
    """A session of OpenBot, by its own logs or by its notebook's table."""
    made, at, last = Made(home / "session"), 10**18, None
    frames, controls = ["timestamp[ns],frame"], ["timestamp[ns],leftCtrl,rightCtrl"]
    heads = (
        "timestamp,frame,left,right,cmd",
        "timestamp (frame),time_offset (cmd-frame),frame,left,right,cmd",
    )
    matched, is_raw = [dice.choice(heads)], dice.random() < 0.6
    for number, label in drive(dice):
        at += dice.randint(25, 60) * 10**6
        made.add(f"images/{number}_crop.jpeg", number, label)
        fast, slow = dice.randint(150, 255), dice.randint(0, 90)
        left, right = {F: (fast, fast), L: (slow, fast), R: (fast, slow)}[label]
        if label is not last:
            controls.append(f"{at - 10**6},{left},{right}")
        frames.append(f"{at},{number}")
        matched.append(f"{at},/home/me/session/{made.names[number]},{left},{right},0")
        last = label
    put(made.path, "images/999_crop.jpeg", 999)  # without a line
    raw = {"rgbFrames.txt": frames, "ctrlLog.txt": controls}
    ending = dice.choice(["\n", "\r\n"])
    for name, lines in (
        raw if is_raw else {"matched_frame_ctrl_cmd_processed.txt": matched}
    ).items():
        made.write(f"sensor_data/{name}", *lines, ending=ending)
    made.spoil(dice)
    return made.zipped() if dice.random() < 0.3 else made


def tub_of_version_1(dice: random.Random, home: Path) -> Made:
    """A tub of version 1, with any of its three times, missing pictures, and other drivers."""
    made, clock = Made(home / "tub"), dice.choice(["milliseconds", "timestamp", "none"])
    for number, label in drive(dice):
        name, mode = (
            f"{number}_cam-image_array_.jpg",
            dice.choice(["user", "user", "user", "local"]),
        )
        made.add(name, number, label if mode == "user" else None)
        record = {"cam/image_array": name, "user/angle": angle_of(dice, label)}
        record |= {"user/throttle": 0.3, "user/mode": mode}
        at = datetime.fromtimestamp(1.5e9 + 0.05 * number, UTC).replace(tzinfo=None)
        times = {"milliseconds": 50 * number, "timestamp": str(at)}
        record |= {clock: times[clock]} if clock != "none" else {}
        made.write(f"record_{number}.json", json.dumps(record))
    put(made.path, "9999_cam-image_array_.jpg", 999)
    return made.spoil(dice)


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

    is_first = dice.random() < 0.4
    made = Made(home / ("drive.bag" if is_first else "drive"))
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    types = store.types
    raw, is_stamped = dice.choice(["", "", "rgb8", "bgr8", "mono8"]), dice.random() < 0.4

    def header(at_ns: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=at_ns // 10**9, nanosec=at_ns % 10**9)
        more = {"seq": 0} if is_first else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **more)

    def image(number: int, at_ns: int) -> tuple[str, Any]:
        packed = np.frombuffer(picture(number, ".png" if raw else ".jpg"), np.uint8)
        kind = "sensor_msgs/msg/CompressedImage"
        if not raw:
            return kind, types[kind](header=header(at_ns), format="jpeg", data=packed)
        pixels = cv2.imdecode(packed, cv2.IMREAD_COLOR)
        pixels = pixels[:, :, :1] if raw == "mono8" else pixels[:, :, :: -1 if raw == "rgb8" else 1]
        height, width, channels = pixels.shape
        sides = {"height": height, "width": width, "step": width * channels, "is_bigendian": 0}
        data, kind = np.ascontiguousarray(pixels).reshape(-1), "sensor_msgs/msg/Image"
        return kind, types[kind](header=header(at_ns), encoding=raw, data=data, **sides)

    def order(label: Action, at_ns: int) -> tuple[str, Any]:
        vector, kind = types["geometry_msgs/msg/Vector3"], "geometry_msgs/msg/Twist"
        turn = vector(x=0.0, y=0.0, z=-0.7 * angle_of(dice, label))
        twist = types[kind](linear=vector(x=dice.uniform(0.1, 0.6), y=0.0, z=0.0), angular=turn)
        if not is_stamped:
            return kind, twist
        return f"{kind}Stamped", types[f"{kind}Stamped"](header=header(at_ns), twist=twist)

    at_ns, last, messages = 1_700_000_000 * 10**9, None, []
    for number, label in drive(dice):
        at_ns += dice.randint(30, 90) * 10**6
        if number == 0 and dice.random() < 0.3:
            made.truth[500] = None  # there was no command yet
            messages.append(("/camera/image", at_ns - 2 * 10**6, *image(500, at_ns)))
        if label is not last or dice.random() < 0.5:
            messages.append(("/cmd_vel", at_ns - 10**6, *order(label, at_ns)))
        messages.append(("/camera/image", at_ns, *image(number, at_ns)))
        made.truth[number], last = label, label
    plugin = dice.choice([StoragePlugin.SQLITE3, StoragePlugin.MCAP])
    writer: Any = (
        Writer1(made.path) if is_first else Writer2(made.path, version=9, storage_plugin=plugin)
    )
    with writer:
        kinds = {topic: kind for topic, _, kind, _ in messages}
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store)
            for topic, kind in kinds.items()
        }
        write = store.serialize_ros1 if is_first else store.serialize_cdr
        for topic, at, kind, message in messages:
            writer.write(connections[topic], at, write(message, kind))
    if not is_first and dice.random() < 0.5:
        made.path = next(each for each in made.path.iterdir() if each.suffix in (".db3", ".mcap"))
    return made


def lerobot_rover(dice: random.Random, home: Path) -> Made:
    """A dataset with the actions of LeKiwi, EarthRover, ROS or a gamepad, and a depth camera."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    made, rows = Made(home / "set"), []
    body = dice.choice(["lekiwi", "earthrover", "ros", "car"])
    names: Any = {
        "lekiwi": ["arm_gripper.pos", "x.vel", "y.vel", "theta.vel"],
        "earthrover": ["linear_velocity", "angular_velocity"],
        "ros": ["linear.x", "angular.z"],
        "car": {"throttle": 1, "steering": 0},
    }[body]
    for number, label in drive(dice):
        angle, goes = angle_of(dice, label), float(dice.random() >= 0.1)
        action = {
            "lekiwi": [50.0, 0.2 * goes, 0.0, -60 * angle * goes],
            "earthrover": [goes, -angle * goes],
            "ros": [0.2 * goes, -angle * goes],
            "car": [angle, 0.4 * goes],
        }[body]
        made.truth[number] = label if goes else None
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
    (made.path / "data/chunk-000").mkdir(parents=True)
    made.write("meta/info.json", json.dumps(info))
    pq.write_table(pa.Table.from_pylist(rows), made.path / "data/chunk-000/file-000.parquet")
    return made


MAKERS |= {"ros_bag": ros_bag, "lerobot_rover": lerobot_rover}
