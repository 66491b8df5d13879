#!/bin/sh
# simple-pid 2.0.1 (PyPI): a controller that is given its time step never acts again if the step is shorter than 10
# ms.
#
# Guess before running: `pid(value, dt=0.005)` computes with a step of 5 ms, because the caller, such as a simulator,
# controls the time.
# Outcome: wrong. The step is compared with `sample_time`, which is 0.01 s by default, and a shorter step returns the
# last output. The steps are not added up, so each later call returns the first output, whatever is measured. No error
# is raised. With sample_time=None, or a step of 20 ms, the controller works.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check simple-pid==2.0.1
"$folder/env/bin/python" - <<'EOF'
from simple_pid import PID


def outputs(dt_s: float, **options: object) -> list[float]:
    pid = PID(1, 0, 0, setpoint=0, **options)
    return [pid(measured, dt=dt_s) for measured in (1, 2, 3, 300)]


found = {
    "5 ms": outputs(0.005),
    "20 ms": outputs(0.02),
    "5 ms, sample_time=None": outputs(0.005, sample_time=None),
}
print(found)
assert found.pop("5 ms") == [-1, -1, -1, -1]
assert set(map(tuple, found.values())) == {(-1, -2, -3, -300)}
EOF
