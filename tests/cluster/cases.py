"""Experiments on real Dask schedulers and workers, intact and faulty.

Each case returns how a client ended, and the expectation: results equal to those of one process, or
an end with this sentence.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.cluster.processes import Cluster, Ended, run_client

Case = Callable[[Path], tuple[Ended, str]]
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    CASES[function.__name__] = function
    return function


def plain(folder: Path, expected: str, *workers: str, **client: Any) -> tuple[Ended, str]:
    """Run with these workers from the beginning; `expected` is `equal`, or part of the sentence."""
    with Cluster(folder) as cluster:
        for kind in workers:
            cluster.add(kind)
        return run_client(folder, cluster.address, **client), expected


@case
def one_worker(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "good")


@case
def two_workers(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "good", "good")


@case
def four_threads(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "threads")


@case
def without_the_product(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "does not have Drivelesson", "bare")


@case
def other_code(folder: Path) -> tuple[Ended, str]:
    return plain(folder, r"drivelesson [0-9a-f]+ there, [0-9a-f]+ here", "changed")


@case
def other_python(folder: Path) -> tuple[Ended, str]:
    return plain(folder, r"Python 3\.\S+ there, 3\.\S+ here", "python")


@case
def other_numpy(folder: Path) -> tuple[Ended, str]:
    return plain(folder, r"numpy \S+ there, \S+ here", "numpy")


@case
def other_sums(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "its sums differ in the last digits", "blas")


@case
def good_and_changed(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "changed", "good")


@case
def good_and_bare(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "bare", "good", "bare")


@case
def scheduler_without_the_product(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder, kind="bare") as cluster:
        cluster.add("good")
        return run_client(folder, cluster.address), "equal"


@case
def no_worker(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "has had no worker for 10 s; all finished tasks are kept")


@case
def nothing_listens(folder: Path) -> tuple[Ended, str]:
    return run_client(folder, "tcp://127.0.0.1:9"), "no Dask scheduler answers at tcp://127.0.0.1:9"


@case
def without_certificates(folder: Path) -> tuple[Ended, str]:
    return run_client(folder, "tls://127.0.0.1:9"), "no Dask scheduler answers at tls://"


@case
def no_such_host(folder: Path) -> tuple[Ended, str]:
    return run_client(folder, "tcp://nowhere.invalid:8786"), "no Dask scheduler answers"


@case
def no_address(folder: Path) -> tuple[Ended, str]:
    return run_client(folder, "what://is:this"), "no Dask scheduler answers"


@case
def scheduler_killed(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        cluster.add("good")
        ended = run_client(folder, cluster.address, after_first=cluster.kill_scheduler)
    return ended, "the Dask scheduler at .* is lost"


@case
def one_of_two_killed(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        victim = cluster.add("good")
        cluster.add("good")
        return run_client(folder, cluster.address, after_first=victim.kill), "equal"


@case
def one_of_two_frozen(folder: Path) -> tuple[Ended, str]:
    """Like a laptop that falls asleep, perhaps before its answer was fetched."""
    with Cluster(folder) as cluster:
        victim = cluster.add("good")
        cluster.add("good")

        def freeze() -> None:
            time.sleep(1.5)
            victim.freeze()

        return run_client(folder, cluster.address, after_first=freeze, hold="3"), "equal"


@case
def killed_and_started_again(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        victim = cluster.add("good")

        def restart() -> None:
            victim.kill()
            time.sleep(5)
            cluster.add("good")

        return run_client(folder, cluster.address, after_first=restart), "equal"


@case
def all_killed(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        victim = cluster.add("good")
        ended = run_client(folder, cluster.address, after_first=victim.kill)
    return ended, "has had no worker for 60 s"


@case
def late_worker(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        cluster.add_later("good", 4.0)
        return run_client(folder, cluster.address), "equal"


@case
def late_stranger(folder: Path) -> tuple[Ended, str]:
    with Cluster(folder) as cluster:
        cluster.add("good")
        cluster.add_later("changed", 4.0)
        return run_client(folder, cluster.address, runs="8"), "equal"


@case
def idea_of_this_folder(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "equal", "good", learner="ideas.py:honest")


@case
def idea_fails_to_learn(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "ValueError: nothing can be learned", "good", learner="ideas.py:Teaching")


@case
def idea_fails_to_drive(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "ValueError: nothing can be said", "good", learner="ideas.py:Driving")


@case
def idea_fails_oddly(folder: Path) -> tuple[Ended, str]:
    return plain(folder, "NotPicklableError: odd", "good", learner="ideas.py:Odd")


@case
def idea_ends_its_worker(folder: Path) -> tuple[Ended, str]:
    """The third worker is lost with it."""
    return plain(folder, "each time its worker was lost", "nanny", learner="ideas.py:Deadly")


@case
def idea_fails_here(folder: Path) -> tuple[Ended, str]:
    ended = run_client(folder, "here", learner="ideas.py:Teaching")
    return ended, "ValueError: nothing can be learned"


@case
def idea_ends_its_process_here(folder: Path) -> tuple[Ended, str]:
    ended = run_client(folder, "here", jobs="2", learner="ideas.py:Deadly")
    return ended, "a process that ran trials was killed"
