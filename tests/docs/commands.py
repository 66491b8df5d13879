"""Finds commands, options, targets and extras that a page names but that do not exist."""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from robot.devices.options import options_of
from robot.devices.plugins import camera_names, driver_names, load_camera, load_driver
from server.cli import main
from server.lab.bench_command import BENCHMARKS

ROOT = Path(__file__).parents[2]
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]
# cached, because building a parser reads the installed packages
commands, drivers = cache(main.commands), cache(driver_names)
_CODE = re.compile(r"```[^\n]*\n(.*?)```|^( {4}[^\n]*)$|(?<!`)`([^`\n]+)`", re.DOTALL | re.M)
_CALL = re.compile(r"(?:^|[\s/\"(])drivelesson((?: [^|&;#()`\n]+)?)")
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


def unknown(page: str) -> list[str]:
    """Return the commands in a Markdown page that would not work."""
    found: list[str] = []
    for block, indented, span in _CODE.findall(page):
        for code in block.replace("\\\n", " ").splitlines() if block else [indented or span]:
            found += _faults(code)
    return found


def _faults(code: str) -> Iterator[str]:
    for target in re.findall(r"(?:^|[$#(&]|: ) *make ([a-z-]+)", code):
        if target not in TARGETS:
            yield f"make {target}"
    for extras in re.findall(r"drivelesson\[([\w, ]+)\]", code):
        yield from (f"drivelesson[{e}]" for e in re.split(", ?", extras) if e not in EXTRAS)
    arguments = re.search(r"ARGS=[\"']?([^\"']*)", code)
    if arguments and "make run" in code:
        yield from _wrong_words(f"serve {arguments[1]}")
    for words in _CALL.findall(code):
        yield from _wrong_words(words)
    if code.startswith("--"):
        name = _OPTION.match(code)
        if name and name[0] not in _all_options():
            yield code


def _wrong_words(text: str) -> Iterator[str]:
    words = text.split()
    if not words or words[0] in ("COMMAND", "[COMMAND]", "NAME"):
        return
    command = words.pop(0) if not words[0].startswith("-") else "serve"
    if command not in commands():
        yield f"drivelesson {command}"
        return
    known, verbs = _options_of(command)
    robot = words[words.index("--robot") + 1] if "--robot" in words[:-1] else "sim"
    if robot not in drivers():  # a third-party robot, with options of its own
        known = {*known, *(o for o in _OPTION.findall(text) if o.startswith(f"--{robot}-"))}
    if verbs and words and words[0].islower() and words[0] not in verbs:
        yield f"drivelesson {command} {words[0]}"
    for option in _OPTION.findall(" ".join(words)):
        if option not in known:
            yield f"drivelesson {command} {option}"


@cache
def _options_of(command: str) -> tuple[set[str], set[str]]:
    """Return the options of a command and of its verbs, and the verbs."""
    parsers = [main.make_parser(command)]
    verbs: set[str] = set()
    if command == "bench":
        verbs = set(BENCHMARKS)
        parsers += [main.make_parser(command, [name]) for name in BENCHMARKS]
    options = {"--version", "--help"}
    if command in ("serve", "calibrate"):
        for names, load in ((drivers(), load_driver), (camera_names(), load_camera)):
            options |= {o.flag for name in names for o in options_of(load(name).options_type)}
    for parser in parsers:
        for action in parser._actions:
            options.update(action.option_strings)
            if isinstance(action, argparse._SubParsersAction):
                verbs.update(action.choices)
                parsers += action.choices.values()
    return options, verbs


@cache
def _all_options() -> set[str]:
    return set().union(*(_options_of(command)[0] for command in commands()))
