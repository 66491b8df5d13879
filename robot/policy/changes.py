"""Makes changes to a policy, and repeats earlier changes.

A change is an example, an edit that a person made, or the beginning of a drive (`LogEvent`).
"""

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
    """Repeat these changes, in order, for undo, recovery and training from recordings.

    Args:
        policy: The policy that learns.
        events: The changes. If an example's time is negative, the time is unknown.
        on_refused: Called for each change that fails. If None, edits that fail are skipped. An edit
            fails if its image is pinned, or does not exist because its examples are missing.
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
        relabel(policy, event.node_id, Action(event.value))
    elif event.verb == "delete":
        policy.learner.delete_node(event.node_id)
    elif event.verb == "pin":
        policy.learner.pin_node(event.node_id, bool(event.value))
    elif event.verb == "outdate":
        policy.learner.outdate()
    elif event.verb == "alike":
        set_alike(policy, bool(event.value))
    else:
        known = "relabel, delete, pin, outdate, alike"
        raise ValueError(f"unknown edit {event.verb!r}; known: {known}")


def relabel(policy: Policy, node_id: int, label: Action) -> None:
    """Make one learned image vote only for `label`.

    Raises:
        LookupError: If there is no such image.
        ValueError: If `label` is not one of the policy's moves.
    """
    policy.check_move(label)
    usual = policy.usual_point(label) if policy.learner.abilities.angles else None
    steered = () if usual is None else (usual.steering,)
    policy.learner.relabel_node(node_id, Action(label), *steered)


def can_be_alike(policy: Policy) -> bool:
    """Return whether `set_alike` is supported. The learner and the features must be able to mirror
    an example, and at least one turn must have an opposite turn."""
    return policy.learner.abilities.mirrors and policy.kinds.mirror(policy.features) is not None


def set_alike(policy: Policy, alike: bool) -> None:
    """Also learn the mirror image of each past and future example; if `alike` is False, undo this.

    Only the linear part learns the mirror images; the learned images do not change.

    Raises:
        ValueError: If the learner, features or moves cannot be mirrored.
    """
    mirror = policy.kinds.mirror(policy.features)
    if mirror is None or not policy.learner.abilities.mirrors:
        raise ValueError(
            "This learner cannot be told that left and right are alike: it needs a linear part "
            "and two moves that mirror each other."
        )
    if alike != policy.alike:
        policy.learner.reflect(mirror, alike)
        policy.alike = alike
