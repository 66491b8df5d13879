"""The command line in general: version, suggestions, limits, completion."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot.errors import (
    CameraError,
    ConfigurationError,
    DriveError,
    InUseError,
    MissingExtraError,
    NotConnectedError,
    NotFoundError,
    PluginError,
    RecordingError,
)
from server.cli.main import commands, load_command, main

WRONG = [
    (["serv"], "unknown command 'serv' (did you mean 'serve'?)"),
    (["serve", "--lerner", "x"], "(did you mean '--learner'?)"),
    (["serve", "--robot"], "drivelesson serve: argument --robot: expected one argument; see"),
    (["serve", "--robot", "smi"], "(did you mean 'sim'?)"),
    (["serve", "--learner", "defualt"], "(did you mean 'default'?)"),
    (["episodes", "lst"], "(did you mean 'list'?)"),
    (["serve", "--rate", "0"], "--rate: must be a number above 0, not '0'"),
    (["serve", "--rate", "nan"], "--rate: must be a number above 0, not 'nan'"),
    (
        ["serve", "--max-nodes", "-3"],
        "--max-nodes: must be a whole number from 1 to 1024, or 'auto'",
    ),
    (["serve", "--max-nodes", "many"], "--max-nodes: must be a whole number from 1 to 1024"),
    (
        ["serve", "--hostname", "bad name"],
        "--hostname: must be at most 63 letters, digits and hyphens",
    ),
    (["serve", "--port", "70000"], "--port: must be a whole number from 0 to 65535, not '70000'"),
    (["drive"], "unknown command 'drive' (did you mean 'serve'?)"),
    (["serve", "--world", "offce"], "unknown world 'offce' (did you mean 'office'?)"),
    (["class", "--robots", "abc"], "'abc' is neither a number of simulated robots, nor HOST:PORT"),
    (["class", "--lesson", "foolit"], "(did you mean 'fool-it'?)"),
    (["class", "kep"], "(did you mean 'keep'?)"),
    (["board", "--robots", "lists/none"], "cannot read lists"),
    (["class", "--robots", "2,rover"], "'rover' is neither a number"),
    (["serve", "--jpeg-quality", "0"], "--jpeg-quality: must be a whole number from 1 to 100"),
]
INTERNAL = ("_published", "without-linear", "linear-alone", "Namespace", "Traceback", "<class")


@pytest.mark.parametrize(("words", "sentence"), WRONG, ids=lambda value: " ".join(value)[:30])
def test_the_error_for_a_wrong_call_shows_the_right_call(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = main(words)
    except SystemExit as left:
        status = int(left.code or 0)
    said = capsys.readouterr().err
    assert status in (1, 2)
    assert sentence in said
    assert not [name for name in INTERNAL if name in said]


def test_a_copy_that_is_not_installed_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """For example in another program's environment, if this folder is in its path."""
    monkeypatch.setattr("server.cli.main._points", dict)
    assert main([]) == 2
    assert f"not installed for {sys.executable}" in capsys.readouterr().err


FAULTS = [
    (ConfigurationError("no such option"), 2, "no such option"),
    (MissingExtraError("the film", "export"), 2, "drivelesson[export]"),
    (PluginError("no robot is called x"), 2, "no robot is called x"),
    (NotFoundError("no episode of this name"), 2, "no episode of this name"),
    (RecordingError("the model cannot be read"), 2, "the model cannot be read"),
    (InUseError("another drivelesson uses the folder"), 1, "another drivelesson uses the folder"),
    (CameraError("no camera answers"), 1, "no camera answers"),
    (DriveError("the motor is gone"), 1, "the motor is gone"),
    (NotConnectedError("not connected"), 1, "not connected"),
    (OSError(28, "No space left on device", "a.mcap"), 1, "No space left on device: 'a.mcap'"),
    (PermissionError(13, "Permission denied", "b", None, "c"), 1, "Permission denied: 'b' -> 'c'"),
    (OSError(98, "Address already in use"), 1, "Address already in use"),
    (TimeoutError("it took too long"), 1, "it took too long"),
    (KeyboardInterrupt(), 130, ""),
]


@pytest.mark.parametrize(("fault", "status", "said"), FAULTS, ids=lambda value: str(value)[:30])
def test_a_fault_is_one_line_and_its_status_says_whether_another_start_can_help(
    fault: BaseException,
    status: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(args: object) -> int:
        raise fault

    monkeypatch.setattr(load_command("completion"), "run", fail)
    assert main(["completion", "bash"]) == status
    told = capsys.readouterr().err
    if said:
        assert told.startswith("drivelesson: ") and said in told and told.count("\n") == 1
    assert main(["completoin"]) == 2


def test_a_reader_that_ends_early_is_no_error() -> None:
    """As in `drivelesson --help | head -1`; the text is longer than a pipe's buffer."""
    printing = "import sys; from server.__main__ import main; "
    printing += "sys.exit(max(main(['--help']) for _ in range(50)))"
    program = subprocess.Popen(
        [sys.executable, "-c", printing], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert program.stdout is not None
    program.stdout.readline()
    program.stdout.close()
    _, said = program.communicate(timeout=60)
    assert (program.returncode, said) == (0, b"")


def test_the_starting_page_is_shown_before_fastapi_is_imported() -> None:
    """FastAPI and the routes take most of the CPU time of a start."""
    program = """
import sys
from server.cli.main import make_parser
make_parser("serve", ["--robot", "sim"]).parse_args(["--class-key", "x", "--keep-drives"])
import robot.devices.rig, server.hosting.starting_page
print("numpy" in sys.modules, "fastapi" in sys.modules)
import server.app
print("fastapi" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.split() == ["True", "False", "True"], done.stderr


def test_a_plugin_may_have_a_module_named_options_that_declares_none(tmp_path: Path) -> None:
    """`drivelesson serve` imports the module `options` of each extension's package."""
    package, installed = tmp_path / "lamp", tmp_path / "lamp-1.dist-info"
    for folder in (package, installed):
        folder.mkdir()
    (package / "__init__.py").touch()
    (package / "options.py").write_text("BRIGHTNESS = 0.5\n")
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: lamp\nVersion: 1\n")
    (installed / "entry_points.txt").write_text("[drivelesson.services]\nlamp = lamp.routes:Lamp\n")
    done = subprocess.run(
        [sys.executable, "-m", "server", "serve", "--help"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "--class-key" in done.stdout


def test_the_overview_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(f"  {name} " in said for name in commands())


def test_bash_completes_commands_options_and_choices(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    ask = """
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _shtab_drivelesson; echo "${COMPREPLY[@]}"
"""
    for words, wanted in (
        (["drivelesson", "ep"], "episodes"),
        (["drivelesson", "serve", "--hostn"], "--hostname"),
        (["drivelesson", "completion", "zs"], "zsh"),
    ):
        done = subprocess.run(
            ["bash", "-c", script + ask, "bash", *words], capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == [wanted]
