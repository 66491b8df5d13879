"""Writes docs/reference/command-line.md from the program itself: `make docs`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from unittest.mock import patch

from robot.devices.options import Option, options_of
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from server.cli.main import commands, load_command
from tests.own_plugins import own_plugins

PAGE = Path(__file__).parents[2] / "docs/reference/command-line.md"
_HEAD = """# The command line

`make docs` writes this page from the program; do not edit it by hand.

Run `drivelesson COMMAND [OPTION ...]`. `drivelesson` without a command is the same as
`drivelesson serve --robot sim`.

| exit status | meaning | what a supervisor should do |
|---|---|---|
| 0 | The command is done, or the program that reads its output has ended. | nothing |
| 1 | The command failed, and may succeed later: there is no camera yet, the disk is full, or the \
port is in use. | start it again |
| 2 | The command failed: first change an option, a setting or a file, or install a missing \
library. | do not start it again |
| 130 | Ctrl-C ended the command. | nothing |

If a command fails, it prints one line on standard error that says what failed and what to do.
"""


def render() -> str:
    """Return the whole page, without any third-party plugins that are installed."""
    own_drivers = patch("server.cli.serve.driver_names", lambda: own_plugins(DRIVERS))
    own_cameras = patch("server.cli.serve.camera_names", lambda: own_plugins(CAMERAS))
    with own_drivers, own_cameras:
        return _render()


def _render() -> str:
    parts = [_HEAD]
    for name, text in commands().items():
        parser = argparse.ArgumentParser(prog=f"drivelesson {name}")
        load_command(name).configure(parser)
        parts.append(f"## drivelesson {name}\n\n{text[0].upper()}{text[1:]}.\n")
        parts.extend(_options(parser))
    for kind, names, load in (
        ("robot", own_plugins(DRIVERS), load_driver),
        ("camera", own_plugins(CAMERAS), load_camera),
    ):
        for name in names:
            rows = [_plugin_row(option) for option in options_of(load(name).options_type)]
            if rows:
                parts.append(f"## Options of `--{kind} {name}`\n\n" + _table(rows))
    return "\n".join(parts)


def _options(parser: argparse.ArgumentParser) -> Iterator[str]:
    rows = [_row(action) for action in parser._actions if _is_option(action)]
    if rows:
        yield _table(rows)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                about = next((a.help for a in action._choices_actions if a.dest == name), "")
                text = _cell(about or "")
                yield f"### {parser.prog} {name}\n\n{text[:1].upper()}{text[1:]}.\n"
                yield from _options(inner)


def _is_option(action: argparse.Action) -> bool:
    hidden = isinstance(action, argparse._HelpAction | argparse._SubParsersAction)
    return not hidden and action.help is not argparse.SUPPRESS


def _row(action: argparse.Action) -> tuple[str, str, str]:
    value = "" if action.nargs == 0 else f" {action.metavar or action.dest.upper()}"
    name = (action.option_strings[-1] if action.option_strings else "") + value
    default = action.default
    is_told = default not in (None, False, argparse.SUPPRESS) and "default" not in str(action.help)
    shown = f"`{default}`" if is_told and not isinstance(default, Path) else ""
    # a path that exists only on this machine
    is_place = isinstance(default, Path) and default.is_absolute()
    told = "see storage.md" if is_place else str(default)
    text = (action.help or "").replace("%(default)s", told).replace("%%", "%")
    return f"`{name.strip()}`", shown, _cell(text, action.choices)


def _plugin_row(option: Option) -> tuple[str, str, str]:
    default = "" if option.default in (None, "") else f"`{option.default}`"
    return f"`{option.flag} {option.name.upper()}`", default, _cell(option.help, option.choices)


def _cell(text: str, choices: Iterable[object] | None = None) -> str:
    """Return the cell of one option: its help, and its possible values if the help does not name
    all of them."""
    values = [str(choice) for choice in choices or ()]
    if not all(value in text for value in values):
        text = "; ".join(filter(None, (text, f"one of {', '.join(values)}")))
    return " ".join(text.split()).replace("|", "\\|")


def _table(rows: list[tuple[str, str, str]]) -> str:
    lines = ["| option | default | meaning |", "|---|---|---|"]
    lines += [f"| {name} | {default} | {text} |" for name, default, text in rows]
    return "\n".join(lines) + "\n"
