"""Differences of other systems' disks, each simulated by a fake."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path, PureWindowsPath

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot.errors import ConfigurationError
from robot.store import folder as folder_module
from robot.store.folder import check_name, free_name, move, write_whole

DEVICES = ["con", "prn", "aux", "nul", "conin$", "conout$"]
DEVICES += [f"{port}{number}" for port in ("com", "lpt") for number in "0123456789¹²³"]
awkward = st.builds(
    "".join,
    st.lists(st.sampled_from([*DEVICES, *DEVICES, "x", ".", " ", ":", "\\", "/", "?", "é", "ı"])),
)
cased = st.builds(lambda name, upper: name.upper() if upper else name, awkward, st.booleans())


@given(cased | st.text(max_size=70))
@example("aux .txt")
@example("COM¹")
@example("a. .")
def test_a_name_that_is_taken_can_stand_on_every_disk(name: str) -> None:
    try:
        tidy = check_name(name)
    except ConfigurationError:
        return
    for file in (tidy, f"{tidy}.mcap", f"{tidy}.edits.json"):
        stem = file.split(".")[0].rstrip(" ").lower()
        assert stem not in DEVICES, "Windows would open a device"
        assert file == file.rstrip(". ") and not set(file) & set('<>:"/\\|?*\0')
        assert PureWindowsPath("C:/data", file).name == file
    assert check_name(tidy) == tidy


@given(st.lists(st.sampled_from(["Kitchen", "kitchen", "KITCHEN", "Straße", "STRASSE", "x" * 64])))
def test_names_that_a_case_blind_disk_mixes_up_are_told_apart(wanted: list[str]) -> None:
    taken: set[str] = set()
    for name in wanted:
        taken.add(free_name(name, taken))
    assert len({name.casefold() for name in taken}) == len(wanted)
    assert all(check_name(name) == name for name in taken)


class SharingError(PermissionError):
    """The error of Windows while another program has a file open."""

    def __init__(self, winerror: int) -> None:
        super().__init__(13, "in use")
        self.winerror = winerror


@pytest.mark.parametrize(
    ("error", "times"),
    [
        *((SharingError(5), 1), (SharingError(32), 5), (SharingError(32), 99)),
        *((PermissionError(13, "no"), 99), (OSError(28, "full"), 99)),
    ],
)
def test_a_file_that_another_program_reads_is_replaced_later_or_stays_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: OSError, times: int
) -> None:
    write_whole(tmp_path / "paired.json", b"old")
    pauses = _refuse(monkeypatch, times, error)
    is_refused = times == 99
    with pytest.raises(type(error)) if is_refused else nullcontext():
        write_whole(tmp_path / "paired.json", b"new")
    assert (tmp_path / "paired.json").read_bytes() == (b"old" if is_refused else b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["paired.json"]
    assert bool(pauses) is isinstance(error, SharingError), "only what passes is waited for"
    assert is_refused or (len(pauses) == times and sum(pauses) < 2)


def test_a_folder_is_moved_with_its_files(tmp_path: Path) -> None:
    write_whole(tmp_path / "a" / "1.npz", b"x")
    move(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b" / "1.npz").read_bytes() == b"x"


def _refuse(monkeypatch: pytest.MonkeyPatch, times: int, error: OSError) -> list[float]:
    """Refuse this number of replacements; return the pauses between the tries."""
    left, replace, pauses = [times], Path.replace, list[float]()

    def refusing(path: Path, target: Path) -> Path:
        left[0] -= 1
        if left[0] >= 0:
            raise error
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", refusing)
    monkeypatch.setattr(folder_module.time, "sleep", pauses.append)
    return pauses
