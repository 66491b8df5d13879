"""Learners on recorded footage, including those with which BSOC is compared."""

import json

import numpy as np
import pytest

from robot.exchange.npz import load_recording
from robot.lab import evaluation
from robot.lab.baselines.networks import ConvolutionalNetwork
from robot.lab.variants import Design
from robot.policy.image import to_grey
from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES, Action
from server.__main__ import main
from tests.kit.states import same_state
from tests.robot.footage import write_footage


@pytest.fixture
def halls(tmp_path):
    """A folder with two recordings of one place."""
    for seed, name in enumerate("AB"):
        write_footage(tmp_path / f"hall_{name}.npz", seed=seed)
    (tmp_path / "._hall_A.npz").write_bytes(b"\0\5\x16\7")  # a hidden file of macOS
    return tmp_path


@pytest.mark.parametrize(
    "changes",
    [{"t": np.zeros(3)}, {"jpeg": np.zeros(12, np.uint8), "offsets": np.arange(13)}],
    ids=["the file", "a picture"],
)
def test_a_broken_recording_is_named_in_one_line(halls, changes, capsys):
    write_footage(halls / "hall_A.npz", **changes)
    assert main(["evaluate", str(halls), "--learners", "published-4"]) == 2
    said = capsys.readouterr().err  # a library may print more about a file that is no JPEG
    (line,) = [line for line in said.splitlines() if line.startswith("drivelesson: ")]
    assert "hall_A" in line and "Traceback" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "there is no folder nowhere"),
        (["HALLS", "--learners", ","], "drivelesson: "),
        (["HALLS", "--json", "HALLS/nowhere/out.json"], "cannot write"),
        (["HALLS", "--json", "HALLS"], "cannot write"),
        (["HALLS", "--light", "1.5"], "must be a number above 0 up to 1"),
        (["HALLS", "--light", "nan"], "must be a number above 0 up to 1"),
    ],
)
def test_a_wrong_call_is_refused_before_anything_is_learned(
    halls, monkeypatch, capsys, words, said
):
    monkeypatch.setattr(evaluation, "judge", lambda *_: pytest.fail("it must not learn"))
    try:
        status = main(["evaluate", *(word.replace("HALLS", str(halls)) for word in words)])
    except SystemExit as left:
        status = left.code
    assert status == 2 and said in capsys.readouterr().err


def test_the_command_writes_both_directions_of_each_learner_and_lesson(halls, capsys):
    out = halls / "out.json"
    words = ["evaluate", str(halls), "--json", str(out), "--learners"]
    assert main([*words, "published-8,default-8,knn-3,knn-3"]) == 0
    pairs = json.loads(out.read_text())["pairs"]
    directions = [("hall_A", "hall_B"), ("hall_B", "hall_A")]
    assert [(p["train"], p["test"]) for p in pairs[::3]] == directions
    assert {p["learner"] for p in pairs} == {"published-8", "default-8", "knn-3"}
    assert all(p["correct"] == round(p["accuracy"] * p["frames"]) for p in pairs)
    # columns of each direction and of the mean
    assert capsys.readouterr().out.count("knn-3") == 3
    assert main([*words, "published-4", "--first", "2,3", "--examples", "3"]) == 0
    pairs = json.loads(out.read_text())["pairs"]
    assert [p["lesson"] for p in pairs] == 2 * ["first 2", "first 3", "3 spread"]
    means = [line for line in capsys.readouterr().out.splitlines() if line.startswith("mean")]
    assert len(means) == 3 and all(p["lesson"] in " ".join(means) for p in pairs)


def test_the_test_can_be_made_darker_and_the_lesson_stays(halls):
    frame = evaluation.load_pairs(halls)[0].test.shots[0].frame(0, 0.0)
    darker = evaluation.darkened(frame, 0.3)
    assert to_grey(darker).mean() == pytest.approx(0.3 * to_grey(frame).mean(), abs=1.5)
    assert evaluation.darkened(frame, 1.0) is frame


@pytest.mark.parametrize(
    ("frames", "in_a_row", "places"),
    [(1, False, [0]), (4, False, [0, 4, 7, 11]), (3, True, [0, 1, 2]), (99, True, [*range(12)])],
)
def test_few_examples_are_spread_over_the_drive_or_are_its_first(frames, in_a_row, places):
    assert evaluation.FramesToLearn(frames, in_a_row).places(12).tolist() == places


def test_angles_are_evaluated_if_the_drives_have_them(tmp_path):
    half, moves = np.full(45, 0.5, "f4"), np.arange(45) % 3
    steered = np.array([0.0, -1.0, 1.0], "f4")[moves]
    for seed, name in enumerate("AB"):
        write_footage(tmp_path / f"hall_{name}.npz", 45, seed, angle=steered, throttle=half)
        write_footage(tmp_path / f"yard_{name}.npz", 45, seed)
        # A tapped angle alternates; the pilot means its average.
        near = steered * np.random.default_rng(seed).uniform(0.3, 1.0, 45).astype("f4")
        angles = {"angle": np.sign(near), "angle_mean": near, "throttle": half}
        write_footage(tmp_path / f"room_{name}.npz", 45, seed, **angles)
    means = {shot.point.steering for shot in load_recording(tmp_path / "room_A.npz").shots}
    assert len(means) > 25
    learners = ["default-8", "knn-3", "without-angle-8"]
    learners += ["angle-knn-3", "angle-ridge-3", "angle-cnn-8"]
    pairs = evaluation.load_pairs(tmp_path)
    rooms = [pair for pair in pairs if pair.place == "room"]
    others = [pair for pair in pairs if pair.place != "room"]
    results = [*evaluation.evaluate(rooms, learners), *evaluation.evaluate(others, learners[:2])]
    for result in results:
        if result["place"] == "yard":
            names = ("angle_error", "angle_correlation", "angle_step")
            assert all(result[name] is None for name in names)
        elif result["place"] == "room":
            assert 0.0 < result["angle_error"] < 1.0, result["learner"]
        else:
            wrong = 1.0 - result["accuracy"]
            assert wrong - 1e-6 <= result["angle_error"] <= 2.0 * wrong + 1e-6
            assert 0.2 < result["angle_correlation"] <= 1.0 and result["angle_step"] > 0.5
    assert "corr." in evaluation.table(results).columns


def test_a_design_without_changes_is_the_default_learner():
    policies = make_policy("default-8"), Design().make(8, "default-8", DEFAULT_MOVES, False)
    rng = np.random.default_rng(0)
    for i in range(60):
        x = rng.integers(0, 256, 1584).astype(np.uint8)
        for policy in policies:
            policy.learn(x, DEFAULT_MOVES[i // 7 % 3], i / 10)
    one, other = policies
    assert same_state(one.get_state(), other.get_state())
    proposed = [p.propose(1, x, under_way=Action.LEFT, at_s=7.0) for p in policies]
    assert proposed[0] == proposed[1] and proposed[0].action is not None


def pictures(n: int) -> list[tuple[np.ndarray, Action]]:
    """A bright bar on one side, which moves a little."""
    rng, made = np.random.default_rng(1), []
    for i in range(n):
        picture = rng.integers(30, 60, (30, 40)).astype(np.uint8)
        at = int(rng.integers(0, 6)) + (28 if i % 2 else 2)
        picture[:, at : at + 6] = 200
        made.append((picture.ravel(), Action.RIGHT if i % 2 else Action.LEFT))
    return made


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["som-9", "som-1", "gng-9", "gng-2", "alvinn-4"])
def test_a_learner_learns_from_the_first_example_on_and_its_state_can_be_moved(name):
    for library in ("minisom", "minigng", "sklearn"):
        pytest.importorskip(library, reason="NOT TESTED: the extra rivals is not installed")
    policy, other = make_policy(name), make_policy(name)
    (first, label), *more = pictures(60)
    policy.learn(first, label)
    assert policy.propose(1, first).action is label
    for x, label in more:
        policy.learn(x, label)
    asked = pictures(90)[60:]
    if name.partition("-")[2] not in "12":  # one or two nodes cannot distinguish two kinds
        proposed = [policy.propose(i, x).action for i, (x, _) in enumerate(asked)]
        assert proposed == [y for _, y in asked]
    other.set_state(policy.get_state())
    x = asked[0][0]
    assert other.propose(1, x).probabilities == policy.propose(99, x).probabilities


@pytest.mark.parametrize("has_softmax", [True, False])
def test_each_gradient_of_a_network_equals_that_of_its_loss(has_softmax):
    rng = np.random.default_rng(3)
    kernels = ((3, 4), (3, 6))
    network = ConvolutionalNetwork(5, (11, 13, 2), kernels, has_softmax=has_softmax)
    xs, columns = rng.normal(size=(4, 11 * 13 * 2)), np.array([0, 2, 1, 2])
    targets = np.eye(3)[columns] if has_softmax else rng.normal(size=(4, 1))
    network.step(xs, targets)
    network.weights = [weights.astype(np.float64) for weights in network.weights]

    def loss():
        outputs = network.predict_proba(xs)
        if has_softmax:
            return float(-np.log(outputs[np.arange(len(xs)), columns]).mean())
        return float(((outputs - targets) ** 2).mean() / 2)

    for weights, slopes in zip(network.weights, network.slopes(xs, targets), strict=True):
        for _ in range(20):
            place = tuple(int(rng.integers(side)) for side in weights.shape)
            middle, step = weights[place], 1e-5
            sides = []
            for weights[place] in (middle - step, middle + step):
                sides.append(loss())
            weights[place] = middle
            measured = (sides[1] - sides[0]) / (2 * step)
            assert abs(measured - slopes[place]) < 1e-4 + 0.02 * abs(measured)
