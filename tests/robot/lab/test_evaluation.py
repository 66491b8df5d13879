from __future__ import annotations

import json
import os
import statistics
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from robot.errors import RecordingError
from robot.exchange.npz import load_recording
from robot.lab import evaluation
from robot.lab.variants import Design
from robot.policy.features import GradientFeatures
from robot.policy.image import to_grey
from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES, Action
from server.__main__ import main
from tests.kit.sizes import only_full
from tests.kit.states import same_state
from tests.robot.footage import write_footage

FOUND = os.environ.get(
    "DRIVELESSON_RECORDINGS", str(Path(__file__).parents[3].parent / "shared/recordings")
)
needs_recordings = pytest.mark.skipif(
    not Path(FOUND).is_dir(), reason=f"no footage in {FOUND}; set DRIVELESSON_RECORDINGS"
)


@pytest.fixture
def halls(tmp_path):
    """A folder with two recordings of one place."""
    for seed, name in enumerate("AB"):
        write_footage(tmp_path / f"hall_{name}.npz", seed=seed)
    return tmp_path


@pytest.mark.parametrize(
    "changes",
    [
        {"jpeg": None},
        {"labels": np.full(12, 9, np.uint8)},
        {"offsets": np.arange(13)},
        {"t": np.zeros(3)},
        {"labels": np.array([{}], object)},
    ],
    ids=["missing", "labels", "offsets", "times", "pickle"],
)
def test_a_broken_recording_is_one_clear_line(halls, changes, capsys):
    write_footage(halls / "hall_A.npz", **changes)
    with pytest.raises(RecordingError, match=r"hall_A\.npz"):
        load_recording(halls / "hall_A.npz")
    assert main(["evaluate", str(halls), "--learners", "knn-3"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_frame_that_is_no_jpeg_names_its_recording(halls, capsys):
    write_footage(halls / "hall_A.npz", jpeg=np.zeros(12, np.uint8), offsets=np.arange(13))
    assert main(["evaluate", str(halls), "--learners", "published-4"]) == 2
    assert "hall_A" in capsys.readouterr().err


def test_the_command_writes_both_directions_of_each_learner_and_lesson(halls, capsys):
    out = halls / "out.json"
    words = ["evaluate", str(halls), "--json", str(out), "--learners"]
    assert main([*words, "published-8,default-8,knn-3,knn-3"]) == 0
    pairs = json.loads(out.read_text())["pairs"]
    assert [(p["train"], p["test"]) for p in pairs[::3]] == [
        ("hall_A", "hall_B"),
        ("hall_B", "hall_A"),
    ]
    assert {p["learner"] for p in pairs} == {"published-8", "default-8", "knn-3"}
    assert all(p["correct"] == round(p["accuracy"] * p["frames"]) for p in pairs)
    assert capsys.readouterr().out.count("knn-3") == 3  # two directions and their mean
    assert main([*words, "published-4", "--first", "2,3", "--examples", "3"]) == 0
    pairs = json.loads(out.read_text())["pairs"]
    assert [p["lesson"] for p in pairs] == 2 * ["first 2", "first 3", "3 spread"]
    means = [line for line in capsys.readouterr().out.splitlines() if line.startswith("mean")]
    assert len(means) == 3 and all(p["lesson"] in " ".join(means) for p in pairs)


@pytest.mark.parametrize("out", ["nowhere/out.json", "."])
def test_an_unwritable_result_is_reported_before_anything_is_learned(
    halls, monkeypatch, capsys, out
):
    monkeypatch.setattr(evaluation, "judge", lambda *_: pytest.fail("it learned"))
    words = ["evaluate", str(halls), "--learners", "published-4"]
    assert main([*words, "--json", str(halls / out)]) == 2
    assert "cannot write" in capsys.readouterr().err


def test_extra_files_of_macos_are_not_recordings(halls):
    for name in "AB":
        (halls / f"._hall_{name}.npz").write_bytes(b"\0\5\x16\7")
    assert [pair.train.name for pair in evaluation.load_pairs(halls)] == ["hall_A", "hall_B"]


class Darkened(GradientFeatures):
    """Features of another plugin, with the name of the features that they are made of."""

    def extract(self, frame):
        return super().extract(frame) // 2


class Divided(GradientFeatures):
    def __init__(self, number):
        self.number = number

    def extract(self, frame):
        return super().extract(frame) // self.number


def test_each_learner_sees_with_its_own_features(halls):
    drive, known = load_recording(halls / "hall_A.npz"), {}
    frame = drive.shots[0].frame(0, 0.0)
    kinds = [GradientFeatures, Darkened, partial(Divided, 3), partial(Divided, 4)]
    for number, features in enumerate([*kinds, GradientFeatures], start=1):
        policy = Design(features=features).make(4, f"mine-{number}", DEFAULT_MOVES, False)
        seen = evaluation.seen_by(policy, drive, known)
        assert np.array_equal(seen[0][0], features().extract(frame)), number
    assert len(known) == len(kinds), "who sees alike is asked once"


@pytest.mark.parametrize("words", [["evaluate", "nowhere"], ["evaluate", ".", "--learners", ","]])
def test_each_wrong_call_fails_with_one_line(words, capsys):
    assert main(words) == 2
    assert capsys.readouterr().err.startswith("drivelesson: ")


def test_balanced_accuracy_weighs_labels_alike():
    f, left = Action.FORWARD, Action.LEFT
    assert evaluation.scores([f, f, f, left], [f, f, f, f]) == (0.75, 0.5)


README = {  # place: 9-nn, published BSOC-32, published BSOC-64
    "asphalt": (0.837, 0.807, 0.828),
    "gym": (0.810, 0.742, 0.813),
    "matroom": (0.776, 0.699, 0.715),
    "office1": (0.680, 0.643, 0.637),
    "simroad": (0.858, 0.813, 0.846),
}


@needs_recordings
@pytest.mark.recordings
@only_full
@pytest.mark.parametrize("place", README)
def test_the_published_figures_of_the_recordings_are_reproduced(place):
    learners = ["knn-9", "published-32", "published-64"]
    pairs = [pair for pair in evaluation.load_pairs(FOUND) if pair.place == place]
    results = list(evaluation.evaluate(pairs, learners))
    for learner, figure in zip(learners, README[place], strict=True):
        own = [r["accuracy"] for r in results if r["learner"] == learner]
        assert len(own) == 2, "one direction after the other"
        assert statistics.mean(own) == pytest.approx(figure, abs=0.015), learner


@pytest.mark.parametrize("light", [0.3, 0.5])
def test_the_test_can_be_made_darker_and_the_lesson_stays(halls, light):
    pair = evaluation.load_pairs(halls)[0]
    frame = pair.test.shots[0].frame(0, 0.0)
    darker = evaluation.darkened(frame, light)
    assert to_grey(darker).mean() == pytest.approx(light * to_grey(frame).mean(), abs=1.5)
    assert evaluation.darkened(frame, 1.0) is frame


@pytest.mark.parametrize("in_a_row", [False, True])
@pytest.mark.parametrize("examples", [1, 5, 10**6])
def test_few_examples_are_spread_over_the_drive_or_its_first(halls, examples, in_a_row):
    pair = evaluation.load_pairs(halls)[1]
    policy = make_policy("published-8")
    drive = evaluation.seen_by(policy, pair.train, {})
    learned: list[np.ndarray] = []
    with mock.patch.object(policy, "learn", lambda x, label, *how: learned.append(x)):
        n_taught = evaluation.teach(policy, drive, evaluation.FramesToLearn(examples, in_a_row))
    every = [policy.extract(shot.frame(0, 0.0)) for shot in pair.train.shots]
    places = [next(i for i, x in enumerate(every) if np.array_equal(x, y)) for y in learned]
    assert n_taught == len(learned) == min(examples, len(every))
    if in_a_row:
        assert places == list(range(n_taught))
    elif examples > 1:
        gaps = np.diff(places)
        assert (places[0], places[-1]) == (0, len(every) - 1) and np.ptp(gaps) <= 1


@pytest.mark.parametrize("light", ["0", "1.5", "half", "nan"])
def test_impossible_values_of_brightness_are_refused(tmp_path, capsys, light):
    with pytest.raises(SystemExit):
        main(["evaluate", str(tmp_path), "--light", light])
    assert "must be a number above 0 up to 1" in capsys.readouterr().err


def test_the_mean_of_a_tapped_angle_is_what_was_meant(tmp_path):
    tapped, mean = np.tile([0.0, 1.0], 6).astype("f4"), np.full(12, 0.5, "f4")
    changes = {"angle": tapped, "angle_mean": mean, "throttle": mean}
    write_footage(tmp_path / "hall_A.npz", **changes)
    shots = load_recording(tmp_path / "hall_A.npz").shots
    assert {shot.point.steering for shot in shots} == {0.5}


def test_angles_are_judged_where_the_drives_have_them(tmp_path):
    steered = np.linspace(-1.0, 1.0, 3)[np.array([1, 0, 2])]  # forward, left, right
    for name, seed in (("A", 1), ("B", 2)):
        angle = (steered[np.arange(60) % 3]).astype(np.float32)
        write_footage(
            tmp_path / f"hall_{name}.npz", 60, seed, angle=angle, throttle=np.full(60, 0.5, "f4")
        )
        write_footage(tmp_path / f"yard_{name}.npz", 60, seed)
    results = list(evaluation.evaluate(evaluation.load_pairs(tmp_path), ["default-8", "knn-3"]))
    for result in results:
        if result["place"] == "yard":
            names = ("angle_error", "angle_correlation", "angle_step")
            assert all(result[name] is None for name in names)
            continue
        wrong = 1.0 - result["accuracy"]
        assert wrong - 1e-6 <= result["angle_error"] <= 2.0 * wrong + 1e-6  # all or nothing
        assert 0.2 < result["angle_correlation"] <= 1.0 and result["angle_step"] > 0.5
    assert "corr." in evaluation.table(results).columns


def test_proportional_baselines_are_evaluated_beside_the_default(tmp_path):
    for seed, name in enumerate("AB"):
        near = np.random.default_rng(seed).uniform(0.3, 1.0, 60)
        angle = np.array([0.0, -1.0, 1.0])[np.arange(60) % 3] * near
        changes = {"angle": angle.astype("f4"), "throttle": np.full(60, 0.5, "f4")}
        write_footage(tmp_path / f"hall_{name}.npz", 60, seed, **changes)
    learners = ["without-angle-8", "angle-knn-3", "angle-ridge-3", "angle-cnn-8"]
    results = list(evaluation.evaluate(evaluation.load_pairs(tmp_path), learners))
    assert [result["learner"] for result in results[:4]] == learners
    assert all(0.0 < result["angle_error"] < 1.0 for result in results)


@pytest.mark.parametrize("name", ["angle-knn-1", "angle-ridge-1"])
def test_a_proportional_baseline_makes_the_move_that_its_angle_counts_as(name):
    first, second = (make_policy(name).learner for _ in range(2))
    near = np.linspace(-1.0, 1.0, 21)
    first.begin_angles({"left": -1.0, "forward": 0.0, "right": 1.0})
    for angle in near:
        move = "left" if angle < -0.2 else "right" if angle > 0.2 else "forward"
        first.learn_in(np.array([1e4 * angle, 0.0]), move, (), float(angle))
    second.set_state(first.get_state())
    for learner in (first, second):
        for angle, move in ((-0.72, "left"), (0.1, "forward"), (0.6, "right")):
            said = learner.explain_one(np.array([1e4 * angle, 0.0]))
            assert said.label == move and said.angle == pytest.approx(angle, abs=0.05)
    with pytest.raises(ValueError):
        first.relabel_node(1, "left")


def test_a_design_without_changes_is_the_default_learner():
    policies = make_policy("default-8"), Design().make(8, "default-8", DEFAULT_MOVES, False)
    rng = np.random.default_rng(0)
    for i in range(60):
        x = rng.integers(0, 256, 1584).astype(np.uint8)
        for policy in policies:
            policy.learn(x, DEFAULT_MOVES[i // 7 % 3], i / 10)
    one, other = policies
    assert same_state(one.get_state(), other.get_state())
    for under_way in (None, Action.LEFT):
        proposed = [policy.propose(1, x, under_way=under_way, at_s=7.0) for policy in policies]
        assert proposed[0] == proposed[1] and proposed[0].action is not None
