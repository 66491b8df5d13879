"""Print a shell script that completes commands, options and choices with the tab key."""

from __future__ import annotations

import argparse

from robot.errors import PluginError, need
from server.cli.main import commands, make_parser

_SHELLS = ("bash", "zsh", "tcsh")


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=_SHELLS, help="the shell")


def run(args: argparse.Namespace) -> int:
    shtab = need("shtab", "tab completion", "sim")
    whole = argparse.ArgumentParser(prog="drivelesson")
    whole.add_argument("--version", action="store_true", help="print the version")
    subparsers = whole.add_subparsers()
    for name, text in commands().items():
        try:
            parser = make_parser(name)
        except PluginError:
            # this system lacks a module that the robot's driver needs, for example Windows fcntl
            parser = make_parser(name, is_extended=False)
        subparsers.add_parser(name, help=text, parents=[parser], add_help=False)
    print(shtab.complete(whole, args.shell))
    return 0
