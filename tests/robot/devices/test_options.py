"""Fields of a dataclass become options and flags."""

from __future__ import annotations

import math
from argparse import ArgumentParser
from dataclasses import dataclass, field
from typing import Any

import pytest

from robot.devices.options import Option, make_options, options_of
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from robot.errors import ConfigurationError
from server.cli.parser import declare
from tests.own_plugins import own_plugins


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    world: str = field(default="box", metadata={"help": "where", "choices": ("box", "office")})
    frame_rate: float = field(default=30.0, metadata={"help": "pictures a second"})
    seed: int | None = field(default=None, metadata={"help": "chance"})
    loop: bool = field(default=True, metadata={"help": "again and again"})


def test_fields_become_options() -> None:
    world, rate, seed, _ = options_of(Sample)
    assert (world.flag, world.default, world.help) == ("--world", "box", "where")
    assert (rate.flag, rate.type) == ("--frame-rate", float)
    assert seed.type is int


def test_text_is_parsed_and_unknown_names_are_ignored() -> None:
    made = make_options(Sample, {"frame_rate": "10", "seed": "3", "loop": "no", "port": "x"})
    assert made == Sample(frame_rate=10.0, seed=3, loop=False)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"frame_rate": "fast"}, "--frame-rate must be a number, not 'fast'"),
        ({"world": "moon"}, "--world cannot be 'moon'; choose one of: box, office"),
        ({"loop": "perhaps"}, "--loop must be true or false, not 'perhaps'"),
    ],
)
def test_a_bad_value_is_a_clear_error(given: dict[str, str], expected: str) -> None:
    with pytest.raises(ConfigurationError, match=expected):
        make_options(Sample, given)


def test_choices_may_be_numbers_and_help_may_have_a_percent_sign() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Motor:
        gear: int = field(default=1, metadata={"help": "50 % or 100 %s", "choices": [1, 2, 4]})

    assert make_options(Motor, {"gear": "4"}) == make_options(Motor, {"gear": 4}) == Motor(gear=4)
    for wrong in ("3", 3):
        with pytest.raises(ConfigurationError, match="choose one of: 1, 2, 4"):
            make_options(Motor, {"gear": wrong})
    parser = ArgumentParser()
    declare(parser, options_of(Motor)[0])
    assert "50 % or 100 %s: 1, 2, 4 (default: 1)" in " ".join(parser.format_help().split())


NUMBERS = [
    (kind, option)
    for kind in [
        *(load_driver(name) for name in own_plugins(DRIVERS)),
        *(load_camera(name) for name in own_plugins(CAMERAS)),
    ]
    for option in options_of(kind.options_type)
    if option.type in (int, float)
]


@pytest.mark.parametrize(
    ("kind", "option"), NUMBERS, ids=[f"{kind.name} {option.flag}" for kind, option in NUMBERS]
)
def test_every_number_has_a_range_and_keeps_to_it(kind: Any, option: Option) -> None:
    assert option.range is not None, "the option's help needs a range beside it"
    least, most = option.range
    assert least <= option.default <= most
    outside = [least - 1, most + 1, -math.inf, math.inf, math.nan]
    for value in outside:
        is_text = math.isfinite(value) or option.type is float
        for given in [value, str(option.type(value))] if is_text else [value]:
            with pytest.raises(ConfigurationError, match=f"{option.flag} must be a .*number from"):
                make_options(kind.options_type, {option.name: given})
        with pytest.raises(ConfigurationError, match=f"{option.flag} must be a .*number from"):
            kind.options_type(**{option.name: value})  # however the options were made
