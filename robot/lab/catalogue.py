"""All experiments by name; each is imported when it is asked for."""

from __future__ import annotations

from pkgutil import resolve_name

from robot.lab.experiment import Experiment

EXPERIMENTS = {
    "figure3": "robot.lab.figure3:FIGURE3",
    "figure5": "robot.lab.figure5:FIGURE5",
    "figure6": "robot.lab.lessons:FIGURE6",
    "figure7": "robot.lab.lessons:FIGURE7",
    "figure8": "robot.lab.lessons:FIGURE8",
    "behaviours": "robot.lab.behaviours:BEHAVIOURS",
    "ablation": "robot.lab.ablation:ABLATION",
    "habits": "robot.lab.habits:GATE",
    "ready": "robot.lab.ready:READY",
    "mind": "robot.lab.mind:MIND",
    "degrees": "robot.lab.by_degrees:BY_DEGREES",
    "ground": "robot.lab.ground.ground:GROUND",
    "streams": "robot.lab.streams:ONLINE",
}
"""Where each is, in the order in which `all` runs them."""


def load_experiment(name: str) -> Experiment:
    """Return an experiment; raises MissingExtraError if it lacks its libraries."""
    experiment: Experiment = resolve_name(EXPERIMENTS[name])
    return experiment
