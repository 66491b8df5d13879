"""The required content of a data folder: read from a running server, and compared after the next
start."""

from __future__ import annotations

from typing import Any

from robot.coaching.gallery import images
from server.library.models import ModelLibrary
from server.recordings.part import Recordings
from tests.server.virtual_server import VirtualServer

Facts = dict[str, Any]
GROUPS = ("models", "learner", "episodes", "identity", "sessions")


def read(server: VirtualServer, secrets: dict[str, str], groups: tuple[str, ...]) -> Facts:
    """Return the facts of these groups as plain values."""
    return {group: _READ[group](server, secrets) for group in groups}


def _models(server: VirtualServer, _: dict[str, str]) -> Any:
    kept = server.persistence
    saved = {
        one.name: one.summary.place
        for one in ModelLibrary(kept.storage, kept.models).saved()
        if one.summary
    }
    in_use = kept.autosave.name if kept.autosave.name == kept.models.current else None
    return {"saved": saved, "in use": in_use}  # None: the answer said that it is not saved


def _learner(server: VirtualServer, _: dict[str, str]) -> Any:
    policy = server.rig.loop.history.policy
    return {
        "learner": policy.name,
        "pinned": sum(image.is_pinned for image in images(policy)),
        "alike": policy.alike,
    }


def _episodes(server: VirtualServer, _: dict[str, str]) -> Any:
    found = server.persistence.part(Recordings).episodes.summaries()
    run = server.persistence.run
    return {
        one.id: [one.title, one.is_protected, one.edits, one.frames]
        for one in found
        if one.id != run and one.frames  # the next start removes empty runs
    }


def _identity(server: VirtualServer, _: dict[str, str]) -> Any:
    now = server.services.identity.now
    return [now.name, now.colour]


def _sessions(server: VirtualServer, secrets: dict[str, str]) -> Any:
    pairing: Any = server.services.gateway.pairing  # type: ignore[attr-defined]
    return {name: pairing.find(secret) is not None for name, secret in secrets.items()}


_READ = {
    "models": _models,
    "learner": _learner,
    "episodes": _episodes,
    "identity": _identity,
    "sessions": _sessions,
}


def lost(wanted: Facts, found: Facts) -> list[str]:
    """Return the facts that were answered and are lost.

    There may be additional episodes, since the last run becomes one, and a new model.
    """
    gone = []
    for group, value in wanted.items():
        held = found[group]
        if group == "episodes":
            held = {one: held.get(one) for one in value}
        if group == "models":
            saved = {one: held["saved"].get(one) for one in value["saved"]}
            held = {"saved": saved, "in use": held["in use"] if value["in use"] else None}
        if held != value:
            gone.append(f"{group}: answered {value}, found {held}")
    return gone
