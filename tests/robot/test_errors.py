"""Errors of the system and of libraries are raised as ours."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, RecordingError, told_as


def test_an_error_of_the_system_is_converted_with_its_reason_and_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "none"
    said = f"cannot read {file}: No such file or directory; choose another"
    with (
        pytest.raises(ConfigurationError, match=f"^{re.escape(said)}$") as raised,
        told_as(ConfigurationError, f"cannot read {file}", do="choose another"),
    ):
        file.read_bytes()
    assert isinstance(raised.value.__cause__, FileNotFoundError)


def test_only_the_named_kinds_of_errors_are_converted() -> None:
    with (
        pytest.raises(RecordingError, match=r"^it is damaged: KeyError\(\)$"),
        told_as(RecordingError, "it is damaged", KeyError, ValueError),
    ):
        raise KeyError
    with pytest.raises(OSError, match=r"^another$"), told_as(RecordingError, "damaged", KeyError):
        raise OSError("another")


def test_a_long_reason_from_another_program_is_truncated() -> None:
    with (
        pytest.raises(RecordingError, match=r"^damaged: x{300}$"),
        told_as(RecordingError, "damaged", ValueError),
    ):
        raise ValueError("x" * 10_000)
