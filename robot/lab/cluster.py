"""Runs tasks on the workers of a Dask cluster, one at a time per worker.

Before its first task, a worker reports everything that affects its results (`identify_all`). A
worker whose report differs from this computer's gets no task. Each task is assigned to one worker,
and reassigned if this worker is lost. A task is submitted as a call of Python's `eval`, because
scheduler and worker can unpickle such a call without this program.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import inspect
import logging
import pickle
import queue
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from robot.errors import ConfigurationError, need
from robot.lab import identity
from robot.lab.outcome import Outcome, contents_of, run_task
from robot.lab.task import Task

_WHO = "(lambda space: (exec(source, space), space['identify_all']())[1])({'__name__': 'identity'})"
_RUN = "__import__('robot.lab.cluster', fromlist=['run_packed']).run_packed(packed)"
_CONNECT_S = 10.0
_LOOK_S = 1.0
"""Interval at which the scheduler is asked for its workers, in seconds."""
_FIRST_WORKER_S, _NO_WORKER_S = 10.0, 60.0
"""`run_on_cluster` gives up when there has been no worker for this time, in seconds:
`_FIRST_WORKER_S` before the first worker has connected, and `_NO_WORKER_S` later."""
_SILENT_S = 20.0
"""Interval of the messages about a worker that is silent or not yet identified, in seconds."""
_FROZEN_S = 60.0
"""Time after which the task of a silent worker is reassigned, in seconds; Dask waits for 300 s."""
_FETCH_S = 3.0
"""Time limit for fetching an answer, in seconds. Without this limit, the wait for a killed worker's
answer would not end.
"""
_MOST_LOSSES = 3
"""Number of lost workers with the same task after which the experiment ends with an error."""

OnWorkers = Callable[[int, str], object]
"""A callback that receives the number of workers in use, and a sentence about the latest change.
The sentence is empty if nothing has changed."""


def run_on_cluster(
    scheduler: str | None, waiting: Mapping[str, Task], on_workers: OnWorkers
) -> Iterator[tuple[str, Outcome, str]]:
    """Yield each finished task's key, its outcome and the name of its worker.

    Raises ConfigurationError if the cluster cannot be reached, is lost, or has no usable worker.
    """
    distributed = need("distributed", "the backend dask", "dask")
    if scheduler is None:
        raise ConfigurationError("--backend dask needs --scheduler ADDRESS")
    if not waiting:
        return
    with _quiet(), contextlib.ExitStack() as stack:
        try:
            # Try to connect first, because a failing Client waits for 20 s and prints a traceback.
            asyncio.run(_try_to_connect(scheduler))
            client = distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except Exception as error:  # the type of the error depends on the address and the network
            raise ConfigurationError(
                f"no Dask scheduler answers at {scheduler}: {_first_line(error)}; is it running, "
                "is the address right, and does tls:// have its certificates?"
            ) from error
        stack.callback(_close, client)
        yield from _Run(client, scheduler, waiting, on_workers).outcomes()


def run_packed(packed: bytes) -> Outcome:
    """Run a task with its files, on a worker."""
    outcome = run_task(*pickle.loads(packed))
    _tidy_up()
    return outcome


def _tidy_up() -> None:
    """Free the memory that a finished trial still occupies on a worker.

    A trial's objects occupy some MB, and have reference cycles, which Python rarely collects in a
    process with as many objects as Dask's. Dask's profiler also keeps samples of call stacks for
    about a thousand seconds. This function collects the cycles and deletes the samples.
    """
    gc.collect()
    with contextlib.suppress(AttributeError, ValueError):
        worker = need("distributed", "the backend dask", "dask").get_worker()
        worker.profile_history.clear()
        worker.profile_keys_history.clear()


@dataclass(slots=True)
class _Worker:
    """A worker, its task, and the time of its last message, by the scheduler's clock (`heard`) and
    by our clock (`heard_s`)."""

    name: str
    began_s: float
    heard: float = 0.0
    heard_s: float = 0.0
    future: Any = None
    key: str = ""
    """The key of the worker's task; empty while the worker is being identified."""
    is_used: bool = False
    said_s: float = 0.0
    """The duration of the worker's silence that was last reported to the user, in seconds."""


class _Run:
    """The tasks of one call, and the workers that run them."""

    def __init__(
        self, client: Any, scheduler: str, tasks: Mapping[str, Task], on_workers: OnWorkers
    ) -> None:
        self._client, self._scheduler, self._tasks = client, scheduler, tasks
        self._on_workers = on_workers
        self._todo = list(tasks)[::-1]
        self._workers: dict[str, _Worker] = {}
        self._events: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self._lost: Counter[str] = Counter()
        self._refused: dict[str, str] = {}
        self._left = len(tasks)
        self._ours = identity.identify_all()
        self._alone_since_s = time.monotonic()
        self._said_s = self._alone_since_s
        self._had_workers = False

    def outcomes(self) -> Iterator[tuple[str, Outcome, str]]:
        looked_s = float("-inf")
        while self._left:
            if time.monotonic() - looked_s >= _LOOK_S:
                self._look()
                looked_s = time.monotonic()
            self._hand_out()
            with contextlib.suppress(queue.Empty):
                address, future = self._events.get(timeout=_LOOK_S)
                worker = self._workers.get(address)
                if worker is not None and worker.future is future:
                    yield from self._take(address, worker)

    # Workers -------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Note new and lost workers. Raises ConfigurationError if no worker can be expected."""
        try:
            found = self._client.sync(
                self._client.scheduler.identity, callback_timeout=_CONNECT_S, n_workers=-1
            )["workers"]
        except Exception as error:
            raise ConfigurationError(
                f"the Dask scheduler at {self._scheduler} is lost; finished tasks are kept. "
                "Start the scheduler and its workers, then run the same command again"
            ) from error
        now_s = time.monotonic()
        for address in [address for address in self._workers if address not in found]:
            self._drop(address)
        for address, facts in found.items():
            if address not in self._workers:
                self._workers[address] = _Worker(f"{facts['host']} ({address})", now_s)
                self._submit(address, _WHO, source=inspect.getsource(identity))
            self._listen(address, float(facts.get("last_seen", 0.0)), now_s)
        self._end_if_alone(now_s)

    def _listen(self, address: str, heard: float, now_s: float) -> None:
        """Report a worker that is silent; after a while reassign its task."""
        worker = self._workers[address]
        if heard != worker.heard:
            worker.heard, worker.heard_s, worker.said_s = heard, now_s, 0.0
        since_s = worker.heard_s if worker.is_used or worker.future is None else worker.began_s
        silent_s = now_s - since_s
        if silent_s > _FROZEN_S and worker.is_used:
            # A worker that answers again is identified again.
            self._drop(address, "does not answer; its task goes to another worker", losses=0)
        elif silent_s > worker.said_s + _SILENT_S:
            worker.said_s += _SILENT_S
            self._report(f"the worker at {worker.name} has been silent for {worker.said_s:.0f} s")

    def _drop(self, address: str, why: str = "is gone", losses: int = 1) -> None:
        """Reassign the task of a lost worker."""
        worker = self._workers.pop(address)
        self._refused.pop(address, None)
        if worker.future is not None:
            worker.future.release()
        if worker.key:
            self._lost[worker.key] += losses
            if self._lost[worker.key] >= _MOST_LOSSES:
                raise ConfigurationError(
                    f"the run {self._tasks[worker.key]} was started {_MOST_LOSSES} times, and its "
                    "worker was lost each time; do the workers have enough memory?"
                )
            self._todo.append(worker.key)
        self._report(f"the worker at {worker.name} {why}")

    def _end_if_alone(self, now_s: float) -> None:
        if any(worker.is_used or worker.future for worker in self._workers.values()):
            self._alone_since_s, self._had_workers = now_s, True
            self._said_s = now_s
            return
        if self._refused:
            raise ConfigurationError(
                "no worker can be used: " + "; ".join(dict.fromkeys(self._refused.values()))
            )
        if now_s - self._said_s > _SILENT_S:
            self._said_s = now_s
            alone_s = now_s - self._alone_since_s
            self._report(f"no worker for {alone_s:.0f} s; waiting for a worker")
        patience_s = _NO_WORKER_S if self._had_workers else _FIRST_WORKER_S
        if now_s - self._alone_since_s > patience_s:
            raise ConfigurationError(
                f"the Dask scheduler at {self._scheduler} has had no worker for {patience_s:.0f} "
                "s; finished tasks are kept. If workers end immediately, read their output. "
                f"Start workers with: dask worker {self._scheduler} --nthreads 1"
            )

    def _report(self, change: str) -> None:
        self._on_workers(sum(worker.is_used for worker in self._workers.values()), change)

    # Tasks ---------------------------------------------------------------------------------------

    def _hand_out(self) -> None:
        for address, worker in self._workers.items():
            if self._todo and worker.is_used and worker.future is None:
                worker.key = self._todo.pop()
                task = self._tasks[worker.key]
                self._submit(address, _RUN, packed=pickle.dumps((task, contents_of(task))))

    def _submit(self, address: str, text: str, **names: Any) -> None:
        """Let a worker evaluate a Python expression; `names` contains its variables."""
        future = self._client.submit(
            eval, text, names, workers=[address], allow_other_workers=False, pure=False
        )
        self._workers[address].future = future
        future.add_done_callback(lambda done: self._events.put((address, done)))

    def _take(self, address: str, worker: _Worker) -> Iterator[tuple[str, Outcome, str]]:
        """Process a worker's answer: its identity, or a task's outcome."""
        future, key, answer = worker.future, worker.key, None
        if future.status == "finished":
            try:
                answer = future.result(timeout=_FETCH_S)
            except TimeoutError:
                self._events.put((address, future))  # ask again until the worker answers or is lost
                return
            except Exception:  # the worker was killed, and Dask tried the task again
                future.release()
        worker.future, worker.key = None, ""
        if answer is None:
            self._take_failure(address, worker, future, key)
        elif key:
            self._left -= 1
            yield key, answer, f" on the worker at {worker.name}"
        else:
            self._judge(address, worker, answer)

    def _take_failure(self, address: str, worker: _Worker, future: Any, key: str) -> None:
        """Handle a task without an answer: it could not be run, or its worker was lost."""
        error = future.exception() if future.status == "error" else None
        is_lost = error is None or type(error).__name__ == "KilledWorker"
        if is_lost or not key:
            worker.key = key
            # if the worker is still there, identify it again before its next task
            self._drop(address)
            return
        raise ConfigurationError(
            f"the worker at {worker.name} cannot run {self._tasks[key]}: "
            f"{type(error).__name__}: {_first_line(error)}"
        ) from error

    def _judge(self, address: str, worker: _Worker, theirs: Mapping[str, str]) -> None:
        differs = identity.differences(self._ours, theirs)
        worker.is_used = not differs
        if differs:
            sentence = (
                f"the worker at {worker.name} is not used, because its results would differ: "
                f"{'; '.join(differs)}; install the same versions there"
            )
            self._refused[address] = sentence
            self._report(sentence)
        else:
            self._report(f"the worker at {worker.name} is ready")


async def _try_to_connect(scheduler: str) -> None:
    """Try to connect to the scheduler once; the error says why this failed."""
    comm = await need("distributed.comm", "the backend dask", "dask").connect(
        scheduler, timeout=_CONNECT_S
    )
    await comm.close()


def _first_line(error: BaseException | None) -> str:
    return next(iter(str(error).splitlines()), "") or type(error).__name__


def _close(client: Any) -> None:
    with contextlib.suppress(Exception):  # the connection is already lost
        client.close(timeout=2)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence the library's logs, because this module reports errors in one sentence."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {log: log.level for log in map(logging.getLogger, names)}
    for log in levels:
        log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for log, level in levels.items():
            log.setLevel(level)
