"""Finds names for an environment's actions, because Gymnasium only numbers them.

No standard says where the names are. Atari and NES have a method `get_action_meanings()`. MiniGrid
and MiniWorld have an enumeration `actions`. highway-env has a dictionary in `action_type`, and
Stable-Retro a list `buttons`. ViZDoom has a list of its game's buttons, and a table with the
buttons that each action presses.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_KEPT_IN = (
    "get_action_meanings",
    "action_meanings",
    "action_names",
    "actions",
    "action_type.actions",
    "ACTION_NAMES",
    "ACTION_MEANING",
    "ACTION_LOOKUP",
    "ACTIONS",
    "Actions",
    "buttons",
)
"""Attributes and methods that are known to contain names; the most reliable come first."""
_NOTHING_PRESSED = "noop"


def names_of(env: Any, first: int, n: int) -> dict[int, str]:
    """Return the names of `n` actions, by number; the numbers begin at `first`. Return an empty
    dict if the environment has no names.

    If the environment is wrapped, the names come from the outermost wrapper that has names.
    """
    for layer in _layers(env):
        for path in _KEPT_IN:
            names = _read(_find(layer, path), first, n)
            if names:
                return names
        names = _pressed(layer, first, n)
        if names:
            return names
    return {}


def _layers(env: Any) -> Iterator[Any]:
    """Yield the environment, and each environment that is wrapped in it."""
    for _ in range(32):
        yield env
        inner = getattr(env, "env", None)
        if inner is None or inner is env:
            return
        env = inner


def _find(owner: Any, path: str) -> Any:
    try:
        for name in path.split("."):
            owner = getattr(owner, name)
        is_enumeration = isinstance(owner, type)
        return owner() if callable(owner) and not is_enumeration else owner
    except Exception:  # an environment may raise any error here; the robot works without names, too
        return None


def _read(kept: Any, first: int, n: int) -> dict[int, str]:
    """Return the names in an enumeration, in a list, or in a mapping from or to names. Return no
    names if the value is something else."""
    members = getattr(kept, "__members__", None)
    if isinstance(members, Mapping):
        kept = {name: getattr(member, "value", member) for name, member in members.items()}
    if isinstance(kept, Mapping):
        pairs = list(kept.items())
        if all(isinstance(key, str) for key, _ in pairs):
            pairs = [(value, key) for key, value in pairs]
        found = {int(key): _word(value) for key, value in pairs if _is_whole(key)}
        return {key: found[key] for key in range(first, first + n) if found.get(key)}
    if isinstance(kept, Sequence) and not isinstance(kept, str) and len(kept) == n:
        return {first + i: word for i, value in enumerate(kept) if (word := _word(value))}
    return {}


def _word(value: Any) -> str:
    name = getattr(value, "name", value)
    return name if isinstance(name, str) else ""


def _is_whole(value: Any) -> bool:
    try:
        return bool(int(value) == value)
    except (TypeError, ValueError):
        return False


def _pressed(layer: Any, first: int, n: int) -> dict[int, str]:
    """Return the names of ViZDoom's combinations of buttons."""
    table, game = getattr(layer, "button_map", None), getattr(layer, "game", None)
    if table is None or game is None or len(table) != n:
        return {}
    try:
        buttons = [button.name for button in game.get_available_buttons()][-len(table[0]) :]
        rows = [[one for one, on in zip(buttons, row, strict=True) if on] for row in table]
    except Exception:  # third-party code may raise anything
        return {}
    return {first + i: "_".join(row) or _NOTHING_PRESSED for i, row in enumerate(rows)}
