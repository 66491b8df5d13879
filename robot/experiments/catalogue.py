"""All experiments by name."""

from __future__ import annotations

from robot.experiments.experiment import Experiment
from robot.experiments.figure7 import Figure7

EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in (Figure7(),)}
"""In the order in which `all` runs them."""
