"""Runs lives one after the other on one folder, each killed, with the answers that they gave."""

from __future__ import annotations

import gc
import json
import os
import random
import shutil
import signal
import sys
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.client.facts import Facts
from tests.client.life import Life, describe

_ANEW = 8
"""The number of lives in one data folder. Later lives would spend their time on reading all that
the earlier ones have recorded."""


@dataclass
class Outcome:
    """The result of a run."""

    steps: int = 0
    kills: int = 0
    lives: int = 0
    moving: int = 0
    violations: list[str] = field(default_factory=list)
    done: Counter[str] = field(default_factory=Counter)

    def __add__(self, other: Outcome) -> Outcome:
        return Outcome(
            self.steps + other.steps,
            self.kills + other.kills,
            self.lives + other.lives,
            self.moving + other.moving,
            self.violations + other.violations,
            self.done + other.done,
        )

    def __str__(self) -> str:
        kinds = ", ".join(f"{name} {count}" for name, count in self.done.most_common())
        return (
            f"{self.steps} steps in {self.lives} lives, {self.kills} SIGKILLs, "
            f"moving after {self.moving}, violations {len(self.violations)} ({kinds})"
        )


def run(folder: Path, steps: int, kills: int, seed: int, is_first_enough: bool = False) -> Outcome:
    """Run this number of steps and kills; print violations as they are found.

    With `is_first_enough`, end after the life in which the first was found.
    """
    dice, outcome = random.Random(seed), Outcome()
    root, wanted = folder / "data", Facts()
    secrets = _begin(root)
    spec = describe(folder / "other")
    gc.freeze()
    while outcome.steps < steps and not (is_first_enough and outcome.violations):
        each = max(1, (steps - outcome.steps) // max(1, kills - outcome.kills))
        planned = dice.randint(max(1, each // 2), max(2, each * 3 // 2))
        is_last = outcome.kills >= kills
        _one_life(
            root,
            planned if not is_last else each,
            dice,
            secrets,
            wanted,
            outcome,
            spec,
            kill=not is_last,
        )
        if outcome.lives % 10 == 0:
            print(f"{folder.name}: {outcome}", flush=True)
        if outcome.lives % _ANEW == 0:
            shutil.rmtree(root)
            secrets, wanted = _begin(root), Facts()
    return outcome


def _begin(root: Path) -> dict[str, str]:
    """Make a data folder; return the secrets of the browsers that it knows."""
    root.mkdir(parents=True)
    pairing = Pairing(10, file=root / "paired.json")
    secrets = {}
    roles = {"owner": Role.PILOT, "pupil": Role.PILOT, "viewer": Role.VIEWER}
    for person, role in roles.items():
        paired: Any = pairing.redeem(pairing.tokens[role], 0.0)
        secrets[person] = paired.secret
    return secrets


def _one_life(
    root: Path,
    steps: int,
    dice: random.Random,
    secrets: dict[str, str],
    wanted: Facts,
    outcome: Outcome,
    spec: dict[str, Any],
    *,
    kill: bool,
) -> None:
    """Fork a life; kill it in or after its last steps. `secrets` and `wanted` are updated."""
    seed, way = dice.randrange(2**32), dice.choice(["disk", "any", "any", "between"])
    reading, writing = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        life = Life(root, seed, dict(secrets), dict(wanted), partial(_tell, writing), spec)
        _live(life, steps, dies=kill and way == "disk")
    os.close(writing)
    outcome.lives += 1
    begun: list[str] = []
    last_step, is_killed = "", False
    with os.fdopen(reading) as told:
        for line in told:
            if not line.endswith("\n"):
                break
            one = json.loads(line)
            if "begin" in one:
                begun = [] if one.get("keeps") else one["begin"]
                last_step = one["step"]
            if "facts" in one:
                wanted.update(one["facts"])
                begun = []
            if "unknown" in one:
                for group in one["unknown"]:
                    wanted.pop(group, None)
                begun = []
            if "secret" in one:
                name, secret = one["secret"]
                secrets.pop(name, None)
                if secret:
                    secrets[name] = secret
            if "violation" in one:
                outcome.violations.append(one["violation"])
                print(
                    f"VIOLATION (life {outcome.lives}, seed {seed}): {one['violation']}", flush=True
                )
            if "done" in one:
                outcome.steps += 1
                outcome.done[one["kind"]] += 1
                outcome.moving += one["moves"]
                begun = []
                if kill and not is_killed and way != "disk" and one["done"] >= steps - 1:
                    if way == "any":
                        time.sleep(dice.uniform(0.0, 0.01))
                    os.kill(pid, signal.SIGKILL)
                    is_killed = True
    _, status = os.waitpid(pid, 0)
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL:
        outcome.kills += 1
        for group in begun:  # done or not: no answer arrived
            wanted.pop(group, None)
    elif status:
        outcome.violations.append(f"life {outcome.lives} ended with {status} in {last_step}")
        print(outcome.violations[-1], flush=True)


def _tell(writing: int, one: dict[str, Any]) -> None:
    os.write(writing, (json.dumps(one) + "\n").encode())


def _live(life: Life, steps: int, *, dies: bool) -> None:
    """Run the life, in the child; never returns."""
    code = 0
    try:
        life.run(steps if dies else steps + 40, dies=dies)
        if dies:
            os.kill(os.getpid(), signal.SIGKILL)
    except BaseException:
        life.violate(traceback.format_exc()[-3000:])
        code = 1
    os._exit(code)
