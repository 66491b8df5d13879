"""Restricts tests to the plugins of this program, whatever other plugins are installed."""

from importlib.metadata import distribution


def own_plugins(group: str) -> list[str]:
    return sorted(distribution("drivelesson").entry_points.select(group=group).names)
