"""`drivelesson`, which writes its number of Python objects when it gets SIGUSR1."""

from __future__ import annotations

import gc
import os
import signal
import sys
from pathlib import Path

from server.__main__ import main


def count(signum: int, frame: object) -> None:
    gc.collect()
    Path(os.environ["SOAK_OBJECTS"]).write_text(str(len(gc.get_objects())))


signal.signal(signal.SIGUSR1, count)
sys.exit(main())
