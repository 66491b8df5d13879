"""What the server keeps on disk, joined to one robot: models, and the recordings of its runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fastapi import HTTPException, Request
from starlette.concurrency import run_in_threadpool

from robot.episodes.recorder import Recorder
from robot.episodes.recovery import recover_last
from robot.episodes.store import EpisodeStore
from robot.errors import ConfigurationError, MissingExtraError, NotFoundError, RobotError
from robot.lifecycle import StartStop
from robot.models.autosave import Announce, Autosave, say_nothing
from robot.models.store import ModelStore
from robot.rig.rig import Rig
from robot.storage.folder import Storage
from robot.storage.lock import FolderLock


class Persistence(StartStop):
    """Starts and stops what keeps. A context manager, inside of the rig's."""

    def __init__(
        self,
        storage: Storage,
        rig: Rig,
        *,
        name: str = "robot",
        options: Mapping[str, Any] | None = None,
        announce: Announce = say_nothing,
    ) -> None:
        self.storage = storage
        self._name = name
        self._lock = FolderLock(storage.root)
        self.models = ModelStore(storage)
        self.autosave = Autosave(
            rig.loop, self.models, name=name, moves=rig.driver.moves, announce=announce
        )
        self.recorder = Recorder(
            rig.loop, storage.episodes, robot=name, options=options, announce=announce
        )
        self.episodes = EpisodeStore(storage, recording=lambda: self.recorder.episode_id)

    def start(self) -> None:
        """Take the folder, recover from a power cut, and begin to keep.

        What was kept before is loaded by `autosave.load_last`.

        Raises:
            ConfigurationError: If another program keeps its lessons there.
        """
        self._lock.start()
        self.storage.sweep()
        recover_last(self.storage.episodes, self.models, self._name)
        self.autosave.start()
        self.recorder.start()

    def stop(self) -> None:
        """Finish the recording and save what was learned; the loop must still turn. Idempotent."""
        self.recorder.stop()
        self.autosave.stop()
        self._lock.stop()


def persistence_of(request: Request) -> Persistence:
    """Dependency of routes that need what is kept; 503 where nothing is."""
    persistence = getattr(request.app.state, "persistence", None)
    if not isinstance(persistence, Persistence):
        raise HTTPException(503, "Nothing is kept here: start the server with --data FOLDER.")
    return persistence


def recording_in(app_state: Any) -> str | None:
    """Return the id of the episode that is being recorded, if any is."""
    persistence = getattr(app_state, "persistence", None)
    return persistence.recorder.episode_id if isinstance(persistence, Persistence) else None


@contextmanager
def refusals() -> Iterator[None]:
    """Turn what went wrong into a status and a sentence for the page."""
    try:
        yield
    except NotFoundError as error:
        raise HTTPException(404, str(error)) from error
    except ConfigurationError as error:
        raise HTTPException(409, str(error)) from error
    except MissingExtraError as error:
        raise HTTPException(501, str(error)) from error
    except RobotError as error:
        raise HTTPException(422, str(error)) from error
    except OSError as error:
        raise HTTPException(507, f"The disk refused: {error.strerror or error}") from error


async def do(action: Callable[..., Any], *args: Any) -> Any:
    """Run what touches the disk off the event loop, with errors as answers."""
    with refusals():
        return await run_in_threadpool(action, *args)


async def read_body(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request carries; {} if it has no body.

    Raises:
        HTTPException: 400 if it is anything else.
    """
    raw = await request.body()
    try:
        body = await request.json() if raw else {}
    except (ValueError, RecursionError) as error:
        raise HTTPException(400, "The body is no JSON.") from error
    if not isinstance(body, dict):
        raise HTTPException(400, "The body must be a JSON object.")
    return body


def text_field(body: dict[str, Any], name: str, default: str | None = None) -> str | None:
    """Return a text of the body, or the default; 400 if it is none, or overlong."""
    value = body.get(name, default)
    if value is not None and (not isinstance(value, str) or len(value) > 200):
        raise HTTPException(400, f"{name!r} must be a text of at most 200 characters.")
    return value
