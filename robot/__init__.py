"""Drivelesson: the parts that work without a network. Importing this package imports no hardware
library.

Example:
    >>> from robot.learner import BSOCClassifier
"""

from pathlib import Path as _Path

__version__ = "0.2.0"

PROJECT = "drivelesson"
"""Distinguishes this package from Robot Framework's package of the same name (docs/adr/0008)."""

_CLASH = (
    "Robot Framework and Drivelesson are installed in the same environment, and both have a "
    "package called 'robot', so neither works. Make a new environment for each, for example with "
    "'uv tool install' or 'pipx install', and remove both from this one."
)

if (_Path(__file__).parent / "running").is_dir():  # only Robot Framework has a folder of this name
    raise ImportError(_CLASH)
