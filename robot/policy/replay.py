"""Repeats the changes of a learner."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from robot.policy.events import DriveBegun, Edited, LogEvent, Taught
from robot.policy.policy import Policy
from robot.types import Action


def replay(
    policy: Policy,
    events: Iterable[LogEvent],
    on_refused: Callable[[LogEvent, Exception], None] | None = None,
) -> None:
    """Repeat these changes, in order. Undo, recovery and training from recordings call this
    function.

    Args:
        policy: The policy that learns.
        events: The changes. An example of unknown teaching time has a negative time.
        on_refused: Called for a change that fails; if None, edits that fail are left out. An edit
            fails if its image does not exist or is pinned, because other examples are missing.
    """
    for event in events:
        try:
            make(policy, event)
        except (LookupError, ValueError) as error:
            if on_refused is not None:
                on_refused(event, error)
            elif not isinstance(event, Edited):
                raise


def make(policy: Policy, event: LogEvent) -> None:
    """Make one change. Raises LookupError if the image does not exist, and ValueError if the policy
    refuses or the edit is unknown."""
    if isinstance(event, Taught):
        example, at_s = event.example, event.at_s if event.at_s >= 0.0 else None
        policy.learn(event.x, example.label, at_s, example.point)
    elif isinstance(event, DriveBegun):
        policy.reset()
    elif event.verb == "relabel":
        policy.relabel_node(event.node_id, Action(event.value))
    elif event.verb == "delete":
        policy.learner.delete_node(event.node_id)
    elif event.verb == "pin":
        policy.learner.pin_node(event.node_id, bool(event.value))
    elif event.verb == "outdate":
        policy.learner.outdate()
    elif event.verb == "alike":
        policy.set_alike(bool(event.value))
    else:
        known = "relabel, delete, pin, outdate, alike"
        raise ValueError(f"unknown edit {event.verb!r}; known: {known}")
