"""Options: dataclass fields as flags."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from robot.errors import ConfigurationError
from robot.rig.options import make_options, options_of


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


def test_text_is_parsed_and_foreign_names_are_left_alone() -> None:
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
