"""The command line: `drivelesson COMMAND ...`; without a command it serves the simulated robot."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import Any

from robot.errors import RobotError, did_you_mean
from server.cli.parser import Parser
from server.hosting.low_memory import leave_out_unused

COMMANDS: dict[str, str] = {
    "serve": "drive a robot from the browser",
    "board": "see and stop all robots of a class on one page",
    "evaluate": "compare learners on recorded footage",
    "experiment": "repeat the paper's experiments in simulation",
    "bench": "measure this machine",
    "study": "plan a study with participants, and make its report",
    "episodes": "see, edit, import and export recorded runs",
    "learn": "learn again from recorded runs",
    "new-driver": "write a package for a robot of your own",
    "calibrate": "measure an EV3's speed and turning rate by driving",
    "brick": "put the server, or an agent, on an EV3",
    "completion": "print a script for the shell that completes commands with the tab key",
}
"""Name to one line of help. Each is a module of `server.cli` with `configure(parser)` and
`run(args) -> int`, imported only when asked for: on an EV3 every import costs seconds. Where
options depend on other options, `extend(parser, words)` declares those."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status: 0 done, 1 failed, 2 wrong usage."""
    words = list(sys.argv[1:] if argv is None else argv)
    if words[:1] in (["-h"], ["--help"], ["help"]):
        _print_overview()
        return 0
    if words[:1] in (["-V"], ["--version"]):
        from robot.installation import version

        print(f"drivelesson {version()}")
        return 0
    name = words.pop(0) if words and not words[0].startswith("-") else "serve"
    if name not in COMMANDS:
        hint = did_you_mean(name, COMMANDS)
        print(
            f"drivelesson: unknown command {name!r}{hint}; there are: {', '.join(COMMANDS)}",
            file=sys.stderr,
        )
        return 2
    leave_out_unused()
    try:
        parser = make_parser(name, words)
        return int(_module(name).run(parser.parse_args(words)))
    except RobotError as error:
        print(f"drivelesson: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def make_parser(name: str, words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser of one command; `words` choose the options that depend on others."""
    module = _module(name)
    parser = Parser(prog=f"drivelesson {name}", description=module.__doc__)
    module.configure(parser)
    if hasattr(module, "extend"):
        module.extend(parser, words)
    return parser


def _module(name: str) -> Any:
    return importlib.import_module(f"server.cli.{name.replace('-', '_')}")


def _print_overview() -> None:
    print("usage: drivelesson [COMMAND] [OPTION ...]\n\nTeach a small robot to drive by example.\n")
    for name, text in COMMANDS.items():
        print(f"  {name:12} {text}")
    print(
        "\nWithout a command: serve --robot sim. Options of a command: drivelesson COMMAND --help"
        "\nVersion: drivelesson --version"
    )
