#!/usr/bin/env bash
# distributed 2026.8.0 (PyPI): a worker without results and tasks still grows, by two call trees each second.
#
# Guess before running: a worker that runs small tasks one after the other, whose results are released, keeps nothing
# of them. Its profiler collects stacks in the tree of the current second, which is sent away or dropped at the end of
# the second.
# Outcome: wrong. The tree of each second is kept for a thousand seconds of the worker's life, and a second time under
# the tasks' name. Each node of both trees has four dictionaries. Nobody requested a profile. The history can be
# cleared while the worker runs.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check distributed==2026.8.0
cat > "$folder/part.py" <<'PY'
import distributed


def compute(number):
    """Compute for a moment, in stacks that differ from task to task."""
    name = f"step_{number}"
    text = f"def {name}(n):\n return {name}(n - 1) if n else sum(i * i for i in range(200_000))\n"
    space = {}
    exec(compile(text, f"{name}.py", "exec"), space)
    return [space[name](20) for _ in range(40)][0]


def nodes(tree):
    return 1 + sum(map(nodes, tree["children"].values()))


def look(dask_worker):
    whole = [nodes(tree) for _, tree in dask_worker.profile_history]
    named = [sum(map(nodes, trees.values())) for _, trees in dask_worker.profile_keys_history]
    held = len(dask_worker.data), len(dask_worker.state.tasks)
    return len(whole), sum(whole), sum(named), dask_worker.profile_history.maxlen, held


if __name__ == "__main__":
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster:
        with distributed.Client(cluster) as client:
            seen = []
            for part in range(2):
                for number in range(8):
                    client.submit(compute, 8 * part + number, pure=False).result()
                [found] = client.run(look).values()
                seen.append(found)
    (_, first, _, _, _), (seconds, whole, named, most, held) = seen
    print(f"distributed {distributed.__version__}: results and tasks held: {held}; trees of {seconds} s (of at most")
    print(f"{most}) with {whole} nodes, {first} of them after half the tasks; by the tasks' name {named} more")
    grows = whole - seconds > 1.5 * (first - seen[0][0]) > 0
    raise SystemExit(not (max(held) <= 1 and most == 1000 and grows and named - seconds > (whole - seconds) / 2))
PY
"$folder/venv/bin/python" "$folder/part.py"
