"""The learners to test, some of which belong to extensions that may be removed."""

from robot.policy.registry import is_learner_kind, split_name


def installed(*names: str) -> tuple[str, ...]:
    """Return those of these learners whose kind is installed."""
    return tuple(name for name in names if is_learner_kind(split_name(name)[0]))
