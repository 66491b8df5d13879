"""Experiments on real Dask schedulers and workers, intact and faulty.

Each case returns how a client ended, and the expectation: results equal to those of one process, or
an end with this sentence.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from tests.cluster.processes import Cluster, Ended, Process, run_client

Case = Callable[[Path], tuple[Ended, str]]


def workers(expected: str, *kinds: str, scheduler: str = "good", **client: Any) -> Case:
    """Run with these workers from the beginning; `expected` is `equal`, or part of the sentence."""

    def case(folder: Path) -> tuple[Ended, str]:
        with Cluster(folder, scheduler) as cluster:
            for kind in kinds:
                cluster.add(kind)
            return run_client(folder, cluster.address, **client), expected

    return case


def alone(expected: str, scheduler: str = "here", **client: Any) -> Case:
    """Run without a cluster, perhaps at an address where there is none."""
    return lambda folder: (run_client(folder, scheduler, **client), expected)


def after_first(expected: str, act: Callable[[Cluster, Process], object], **client: Any) -> Case:
    """Do something to the cluster or to its first worker after the first finished task."""
    n_workers = int(client.pop("n_workers", 1))

    def case(folder: Path) -> tuple[Ended, str]:
        with Cluster(folder) as cluster:
            victim, *_ = [cluster.add("good") for _ in range(n_workers)]
            act_now = partial(act, cluster, victim)
            return run_client(folder, cluster.address, after_first=act_now, **client), expected

    return case


def later(kind: str, *kinds: str, **client: Any) -> Case:
    """Add a worker of a kind four seconds after the others; the results are equal."""

    def case(folder: Path) -> tuple[Ended, str]:
        with Cluster(folder) as cluster:
            for each in kinds:
                cluster.add(each)
            cluster.add_later(kind, 4.0)
            return run_client(folder, cluster.address, **client), "equal"

    return case


def _freeze(cluster: Cluster, victim: Process) -> None:
    """Freeze a worker, like a laptop that falls asleep, perhaps before its answer was fetched."""
    time.sleep(1.5)
    victim.freeze()


def _restart(cluster: Cluster, victim: Process) -> None:
    victim.kill()
    time.sleep(5)
    cluster.add("good")


def _kill(cluster: Cluster, victim: Process) -> None:
    victim.kill()


CASES: dict[str, Case] = {
    "one_worker": workers("equal", "good"),
    "two_workers": workers("equal", "good", "good"),
    "four_threads": workers("equal", "threads"),
    "without_the_product": workers("does not have Drivelesson", "bare"),
    "other_code": workers(r"drivelesson [0-9a-f]+ there, [0-9a-f]+ here", "changed"),
    "other_python": workers(r"Python 3\.\S+ there, 3\.\S+ here", "python"),
    "other_numpy": workers(r"numpy \S+ there, \S+ here", "numpy"),
    "other_sums": workers("its sums differ in the last digits", "blas"),
    "good_and_changed": workers("equal", "changed", "good"),
    "good_and_bare": workers("equal", "bare", "good", "bare"),
    "scheduler_without_the_product": workers("equal", "good", scheduler="bare"),
    "no_worker": workers("has had no worker for 10 s; all finished tasks are kept"),
    "nothing_listens": alone("no Dask scheduler answers at tcp://127.0.0.1:9", "tcp://127.0.0.1:9"),
    "without_certificates": alone("no Dask scheduler answers at tls://", "tls://127.0.0.1:9"),
    "no_such_host": alone("no Dask scheduler answers", "tcp://nowhere.invalid:8786"),
    "no_address": alone("no Dask scheduler answers", "what://is:this"),
    "scheduler_killed": after_first(
        "the Dask scheduler at .* is lost", lambda cluster, victim: cluster.kill_scheduler()
    ),
    "one_of_two_killed": after_first("equal", _kill, n_workers=2),
    "one_of_two_frozen": after_first("equal", _freeze, n_workers=2, hold="3"),
    "killed_and_started_again": after_first("equal", _restart),
    "all_killed": after_first("has had no worker for 60 s", _kill),
    "late_worker": later("good"),
    "late_stranger": later("changed", "good", runs="8"),
    "idea_of_this_folder": workers("equal", "good", learner="ideas.py:honest"),
    "idea_fails_to_learn": workers(
        "ValueError: nothing can be learned", "good", learner="ideas.py:Teaching"
    ),
    "idea_fails_to_drive": workers(
        "ValueError: nothing can be said", "good", learner="ideas.py:Driving"
    ),
    "idea_fails_oddly": workers("NotPicklableError: odd", "good", learner="ideas.py:Odd"),
    # The third worker is lost with it.
    "idea_ends_its_worker": workers(
        "each time its worker was lost", "nanny", learner="ideas.py:Deadly"
    ),
    "idea_fails_here": alone("ValueError: nothing can be learned", learner="ideas.py:Teaching"),
    "idea_ends_its_process_here": alone(
        "a process that ran trials was killed", jobs="2", learner="ideas.py:Deadly"
    ),
}
