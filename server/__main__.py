"""`python -m server`, and the command `drivelesson`."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence

_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
"""Environment variables that limit numpy's libraries to one thread. Our matrix products are so
small that with more threads, a trained robot would spend 43 % of its CPU time on waiting."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Return 2 if another project's package `robot` hides ours."""
    for name in (*_ONE_THREAD, "OPENCV_FOR_THREADS_NUM"):
        os.environ.setdefault(name, "1")
    try:
        import robot
    except ImportError as error:
        print(f"drivelesson: {error}", file=sys.stderr)
        return 2
    if getattr(robot, "PROJECT", None) != "drivelesson":
        print(
            f"drivelesson: the package 'robot' in {robot.__path__[0]} belongs to another "
            "project, usually Robot Framework; install drivelesson in a separate environment, for "
            "example with 'uv tool install' or 'pipx install'",
            file=sys.stderr,
        )
        return 2
    for stream in (sys.stdout, sys.stderr):
        # A pipe on Windows can encode only a few characters by default; replace the others.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        from server.cli.main import main as run

        status = run(argv)
        sys.stdout.flush()
    except KeyboardInterrupt:  # Ctrl-C while the modules are imported
        return 130
    except BrokenPipeError:  # the program that reads our output, for example `head`, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return status


if __name__ == "__main__":
    sys.exit(main())
