"""Print a script that completes commands, options and choices with the tab key."""

from __future__ import annotations

import argparse

from robot.errors import PluginError, need

_SHELLS = ("bash", "zsh", "tcsh")


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=_SHELLS, help="whose script")


def run(args: argparse.Namespace) -> int:
    shtab = need("shtab", "tab completion", "sim")
    print(shtab.complete(_whole_parser(), args.shell))
    return 0


def _whole_parser() -> argparse.ArgumentParser:
    """Return one parser with every command in it, as shtab reads it."""
    from server.cli.main import commands as all_commands
    from server.cli.main import make_parser

    whole = argparse.ArgumentParser(prog="drivelesson")
    whole.add_argument("--version", action="store_true", help="print the version")
    commands = whole.add_subparsers()
    for name, text in all_commands().items():
        try:
            parser = make_parser(name)
        except PluginError:  # its robot needs what this system has not, such as fcntl on Windows
            parser = make_parser(name, is_extended=False)
        commands.add_parser(name, help=text, parents=[parser], add_help=False)
    return whole
