"""After a power cut: what was recorded but not yet in a saved model is learned again.

A model is saved every ten seconds, a recording four times a second. So a recording that was cut
short knows lessons that the model in use then does not. Each is looked at once.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

from robot.episodes.edits import Notes, read_notes, write_notes
from robot.episodes.episode import Episode, open_episode
from robot.episodes.recorder import is_recorded_name
from robot.episodes.teaching import learn_again
from robot.errors import RobotError
from robot.models.model import Model, take_model
from robot.models.store import ModelStore
from robot.policy.history import Taught

log = logging.getLogger(__name__)


def recover_last(folder: Path, store: ModelStore, name: str) -> int:
    """Bring the model in use up to the recording that was cut short; return the lessons won back.

    Call it before the model is loaded. What cannot be recovered is logged and left as it is.

    Args:
        folder: Where recordings are.
        shelf: The models.
        name: What the model is called if none was saved yet.
    """
    newest = max(filter(is_recorded_name, folder.glob("*.mcap")), default=None)
    if newest is None:
        return 0
    try:
        notes = read_notes(newest)
        if notes.is_recovered:
            return 0
        episode = open_episode(newest)
        won = _recover(episode, store, name) if episode.damage else 0
        if episode.damage:
            write_notes(newest, replace(notes, is_recovered=True))
    except (RobotError, OSError) as error:
        log.warning("nothing recovered from %s: %s", newest.name, error)
        return 0
    if won:
        log.info("recovered lessons=%d from=%s", won, newest.name)
    return won


def _recover(episode: Episode, store: ModelStore, name: str) -> int:
    before = episode.model_before()
    if before is None:
        return 0
    current = store.current
    saved = store.load(current) if current is not None else before
    if saved.card.learner != before.card.learner:
        return 0
    recovered = _learn_on(saved, before, episode)
    won = recovered.card.lessons - saved.card.lessons
    if won > 0:
        current = current or store.free_name(name)
        store.save(current, recovered)
        store.current = current
    return won


def _learn_on(saved: Model, before: Model, episode: Episode) -> Model:
    """Return the model with all lessons of the recording.

    Where nothing but lessons was recorded, the saved model is the first part of them: only the
    rest is learned. Else all is learned again from what was known before.
    """
    only_lessons = all(isinstance(entry.event, Taught) for entry in episode.lessons)
    known = saved.card.lessons - before.card.lessons
    start = saved if only_lessons and known >= 0 else before
    policy = start.to_policy()
    report = learn_again(policy, [(episode, Notes())], skip=known if start is saved else 0)
    taught = Counter(start.card.taught) + report.taught
    return take_model(policy, taught, saved_at_s=time.time(), place=saved.card.place)
