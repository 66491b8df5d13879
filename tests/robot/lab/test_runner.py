"""Runs are saved one by one, can be resumed, and have the same results in parallel and in sequence.

tests/cluster uses a real cluster.
"""

import inspect
import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robot.errors import ConfigurationError
from robot.lab import identity
from robot.lab.cluster import _WHO, _Run, _Worker
from robot.lab.identity import MISSING, differences, identify, identify_all
from robot.lab.lessons import run_lesson
from robot.lab.outcome import TrialError, contents_of, run_task
from robot.lab.runner import Store, run_all
from robot.lab.task import Params, Result, Task
from tests.kit.run import run

pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
pytest.importorskip("joblib", reason="the extra 'experiments' is not installed")

ROOT = Path(__file__).parents[3]
IDEAS = ROOT / "tests" / "cluster" / "ideas.py"
LESSON = {
    "world": "box",
    "moves": ("forward", "left"),
    "teacher": "usual",
    "learner": "default-8",
    "teach_s": 1.0,
    "correct_s": 0.5,
    "alone_s": 0.5,
    "reference_s": 0.5,
}


def tasks(count: int) -> list[Task]:
    return [Task(run_lesson, {**LESSON, "seed": seed}) for seed in range(count)]


def numbers(results: list[dict[str, Any]]) -> str:
    """Return all figures except speeds, to the last digit."""
    return json.dumps([{k: v for k, v in r.items() if k != "timing"} for r in results])


def run_edit(params: Params) -> Result:
    """Change a file, like a person who edits an idea while it runs."""
    for path in params["files"]:
        Path(path).write_text("a = 2")
    return {"mark": params["mark"]}


def run_read(params: Params) -> Result:
    file, _, name = params["learner"].rpartition(":")
    return {"text": Path(file).read_text(), "name": name, "world": params["world"]}


def run_die(params: Params) -> Result:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def test_results_are_the_same_in_one_process_and_in_several(tmp_path):
    alone = run_all(tasks(2), Store(tmp_path / "a"), jobs=1)
    together = run_all(tasks(2), Store(tmp_path / "b"), jobs=2)
    assert numbers(alone) == numbers(together)
    assert numbers(alone[:1]) != numbers(alone[1:2])


def test_each_task_runs_once_and_an_interrupted_call_loses_no_finished_run(tmp_path):
    first, second = tasks(2)
    Store(tmp_path).put(first, {"mark": 1.0})
    done: list[int] = []

    def note(task):
        done.append(task.params["seed"])
        if len(done) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_all([first, second, *tasks(9)[2:]], Store(tmp_path), jobs=1, on_done=note)
    assert done == [0, 1] and len(list(tmp_path.glob("*.json"))) == 2
    results = run_all([first, second, second], Store(tmp_path), jobs=1, on_done=note)
    assert results[0] == {"mark": 1.0} and "before" in results[1]
    assert results[1] == results[2]
    assert len(list(tmp_path.glob("*.json"))) == 2


def test_a_result_counts_if_it_is_whole_and_was_made_by_this_code(tmp_path):
    store, (task,) = Store(tmp_path), tasks(1)
    store.put(task, {"mark": 1.0})
    (file,) = tmp_path.glob("*.json")
    kept = json.loads(file.read_text())
    assert kept["made_by"] == identify()
    assert store.get(task) == {"mark": 1.0}
    file.write_text(file.read_text()[:-5])
    assert store.get(task) is None
    kept["made_by"]["numpy"] = "0.9"
    file.write_text(json.dumps(kept))
    assert store.get(task) is None
    with pytest.raises(ConfigurationError, match="cannot save results"):
        Store(file / "folder")


@pytest.mark.parametrize("what", ["idea.py:Name", "room.toml", "hall_A.npz"])
def test_the_key_of_a_result_depends_on_the_task_and_the_files_it_names(tmp_path, what):
    first, second = tasks(2)
    assert first.key() == tasks(1)[0].key() != second.key()
    file = tmp_path / what.removesuffix(":Name")
    file.write_bytes(b"a = 1")
    task = Task(run_lesson, {"what": str(tmp_path / what)})
    before = task.key()
    file.write_bytes(b"a = 2\xff")
    assert task.key() != before


def test_a_run_during_which_its_idea_was_changed_counts_for_neither(tmp_path):
    """In an earlier version, the result was saved under the name of the idea's new version."""
    idea, store = tmp_path / "idea.py", Store(tmp_path / "runs")
    idea.write_text("a = 1")
    task = Task(run_edit, {"learner": f"{idea}:Name", "files": [str(idea)], "mark": 1})
    with pytest.raises(ConfigurationError, match="a file of the task edit was changed while"):
        run_all([task], store, jobs=1)
    assert store.get(task) is None
    assert run_all([task], store, jobs=1) == [{"mark": 1}]
    # A change by another task, after the first task has ended, changes no result.
    idea.write_text("a = 1")
    mine = Task(run_edit, {"learner": f"{idea}:Name", "files": [], "mark": 1})
    other = Task(run_edit, {"learner": "default-32", "files": [str(idea)], "mark": 2})
    assert run_all([mine, other], Store(tmp_path / "more"), jobs=1) == [{"mark": 1}, {"mark": 2}]


def test_the_files_that_a_task_names_travel_with_it(tmp_path, monkeypatch):
    (tmp_path / "idea.py").write_text("from here")
    monkeypatch.chdir(tmp_path)
    task = Task(run_read, {"learner": "./idea.py:Name", "world": "box"})
    contents = contents_of(task)
    (tmp_path / "idea.py").unlink()
    read = {"text": "from here", "name": "Name", "world": "box"}
    assert run_task(task, contents).value(task) == read
    assert "idea.py" in run_task(task).error, "without the given contents, the file is missing"


@pytest.mark.parametrize(
    ("name", "error"),
    [("Teaching", "this learner cannot learn"), ("Driving", "this learner cannot propose a move")],
)
def test_an_error_in_an_idea_ends_the_run_with_its_own_traceback(tmp_path, name, error):
    """In an earlier version, the loop went on without the learner, and a table with an SSD of
    359.59 was saved."""
    store, (task,) = Store(tmp_path), tasks(1)
    task = replace(task, params={**task.params, "learner": f"{IDEAS}:{name}"})
    with pytest.raises(TrialError) as caught:
        run_all([task], store, jobs=1)
    said = str(caught.value)
    assert f'File "{IDEAS}", line' in said
    assert said.endswith(f"seed 0 failed: ValueError: {error}")
    assert store.get(task) is None


def test_a_killed_process_is_reported_in_one_sentence(tmp_path):
    with pytest.raises(ConfigurationError, match="a process that ran trials was killed"):
        run_all([Task(run_die, {})], Store(tmp_path), jobs=2)


class NeverFetched:
    """A finished future of Dask, whose worker was killed before the answer was fetched."""

    status = "finished"

    def result(self, timeout):
        raise TimeoutError

    def release(self):
        pass


def test_the_task_of_a_worker_that_is_lost_before_its_answer_was_fetched_goes_to_another():
    """In an earlier version, the client waited forever, because Dask tries again only on the same
    worker."""
    run = _Run(None, "tcp://here", {"key": Task(run_die, {})}, lambda count, change: None)
    run._todo.clear()
    run._workers["lost"] = worker = _Worker("lost", 0.0, future=NeverFetched(), key="key")
    assert list(run._take("lost", worker)) == []
    assert run._events.get_nowait() == ("lost", worker.future), "the client asks the worker again"
    run._drop("lost")
    assert run._todo == ["key"]


@pytest.mark.parametrize(
    ("silent_s", "told"),
    [(19.0, []), (21.0, ["has been silent for 20 s"]), (61.0, ["does not answer"])],
)
def test_a_silent_worker_is_reported_and_its_task_goes_to_another(silent_s, told):
    """In an earlier version, the worker was reported once, and its task waited for Dask's 300 s."""
    said = []
    run = _Run(None, "tcp://here", {}, lambda count, change: said.append(change))
    worker = _Worker("a", 0.0, heard=1.0, future=NeverFetched(), key="key", is_used=True)
    run._workers["address"] = worker
    run._listen("address", 1.0, silent_s)
    assert [change.partition("worker at a ")[2].partition(";")[0] for change in said] == told
    assert run._todo == (["key"] if silent_s > 60 else [])


def test_a_worker_says_which_code_it_has_or_that_it_lacks_this_program():
    """The worker's Python has neither this program nor numpy."""
    source = inspect.getsource(identity)
    program = f"source = {source!r}\nprint({_WHO}['drivelesson'])"
    assert run(sys.executable, "-I", "-S", "-c", program).stdout.strip() == MISSING
    assert eval(_WHO, {"source": source}) == identify_all()
    ours = {"drivelesson": "aa", "Python": "3.12.1", "numpy": "2.0", "arithmetic": "11"}
    assert differences(ours, ours) == []
    bare = {**ours, "drivelesson": MISSING, "numpy": MISSING}
    assert differences(ours, bare) == ["it does not have Drivelesson"]
    other = {**ours, "Python": "3.11.2", "arithmetic": "12", "plugin": "2"}
    versions = ["Python 3.11.2 there, 3.12.1 here", "plugin 2 there, missing here"]
    assert differences(ours, other) == versions
    assert "sums differ" in differences(ours, {**ours, "arithmetic": "12"})[0]
