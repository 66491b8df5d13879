#!/bin/sh
# py_trees 2.6.0: neither interrupt() nor shutdown() nor an error ends the behaviour that drives the motor.
#
# Guess before running: terminate(), in which a behaviour switches its motor off, is called for each running behaviour
# when the tree is interrupted or shut down, or when another behaviour of the same tree raises an exception.
# Outcome: wrong in all three cases. The motor is switched on, and never off. interrupt() ends only the loop of
# tick_tock(). shutdown() calls the behaviours' shutdown(), which does nothing by default; afterwards the behaviour is
# still RUNNING. A behaviour that a timeout ends is terminated, so a test with a timeout passes.
# root.stop(Status.INVALID) does switch the motor off.
#
# Our robots stop if the program does not give them a new order in time.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check py_trees==2.6.0
"$folder/env/bin/python" - <<'PY'
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel
from py_trees.decorators import Timeout
from py_trees.trees import BehaviourTree

told: list[str] = []


class Drive(Behaviour):
    def initialise(self) -> None:
        told.append("on")

    def update(self) -> Status:
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        told.append("off")


class Look(Behaviour):
    def update(self) -> Status:
        if self.status == Status.RUNNING:
            raise OSError("the camera is gone")
        return Status.RUNNING


def found() -> list[str]:
    copy = told.copy()
    told.clear()
    return copy


tree = BehaviourTree(Drive("drive"))
tree.tick_tock(period_ms=10, number_of_iterations=3, post_tick_handler=lambda tree: tree.interrupt())
tree.shutdown()
ended = found()
assert tree.root.status == Status.RUNNING
tree.root.stop(Status.INVALID)
stopped = found()

both = BehaviourTree(Parallel("both", ParallelPolicy.SuccessOnAll(), children=[Drive("drive"), Look("look")]))
raised = "nothing"
try:
    for _ in range(3):
        both.tick()
except OSError as error:
    raised = str(error)
both.shutdown()
failed = found()

late = Timeout("late", Drive("drive"), duration=0.0)
while late.status != Status.FAILURE:
    late.tick_once()
timed_out = found()

print(f"interrupt and shutdown: {ended}, then root.stop: {stopped}")
print(f"error ({raised}): {failed}; timeout: {timed_out}")
assert ended == ["on"] and stopped == ["off"]
assert raised == "the camera is gone" and failed == ["on"]
assert timed_out == ["on", "off"]
PY
