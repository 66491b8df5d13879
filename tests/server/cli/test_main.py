"""The command line suggests commands, reports errors and a full disk, and completes words."""

import os
import signal
import subprocess
import sys

import pytest

from robot.entry_points import EXTENSIONS, points
from robot.errors import (
    CameraError,
    ConfigurationError,
    InUseError,
    MissingExtraError,
    NotFoundError,
    PluginError,
    PluginErrors,
    RecordingError,
)
from server.__main__ import main as start
from server.cli.main import commands, load_command, main
from server.hosting.serving import end_by_signals
from tests.kit.run import run

WRONG = {
    "serv": "unknown command 'serv' (did you mean 'serve'?)",
    "drive": "unknown command 'drive' (did you mean 'serve'?)",
    "serve --lerner x": "(did you mean '--learner'?)",
    "serve --robot": "drivelesson serve: argument --robot: expected one argument; see",
    "serve --robot smi": "(did you mean 'sim'?)",
    "serve --learner defualt": "(did you mean 'default'?)",
    "serve --world offce": "unknown world 'offce' (did you mean 'office'?)",
    "serve --rate nan": "--rate: must be a number above 0, not 'nan'",
    "serve --jpeg-quality 0": "--jpeg-quality: must be a whole number from 1 to 100",
    "episodes lst": "(did you mean 'list'?)",
    "class --robots abc": "'abc' is neither a number of simulated robots, nor HOST:PORT",
    "class --lesson foolit": "(did you mean 'fool-it'?)",
    "class kep": "(did you mean 'keep'?)",
    "board --robots lists/none": "cannot read lists",
    "bench lnk": "(did you mean 'link'?)",
    "bench link --viewers many": "--viewers",
    "bench learner --learner nobody": "default-NUMBER",
    "experiment figure3 --seeds 0": "--seeds: must be a whole number of at least 1",
}
INTERNAL = ("_published", "without-linear", "linear-alone", "Namespace", "Traceback", "<class")


@pytest.mark.parametrize(("words", "sentence"), WRONG.items(), ids=WRONG)
def test_the_error_for_a_wrong_call_shows_the_right_call(words, sentence, capsys):
    try:
        status = main(words.split())
    except SystemExit as left:
        status = int(left.code or 0)
    said = capsys.readouterr().err
    assert status in (1, 2)
    assert sentence in said
    assert not [name for name in INTERNAL if name in said]


def test_a_copy_that_is_not_installed_says_so(monkeypatch, capsys):
    """The program must also start with another program's Python, if this folder is in its path."""
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
    (OSError(28, "No space left on device", "a.mcap"), 1, "No space left on device: 'a.mcap'"),
    (PermissionError(13, "Permission denied", "b", None, "c"), 1, "Permission denied: 'b' -> 'c'"),
    (TimeoutError("it took too long"), 1, "it took too long"),
    (KeyboardInterrupt(), 130, ""),
]


@pytest.mark.parametrize(("fault", "status", "said"), FAULTS, ids=lambda value: str(value)[:30])
def test_an_error_is_one_line_and_its_status_says_whether_a_restart_can_help(
    fault, status, said, monkeypatch, capsys
):
    def fail(args):
        raise fault

    monkeypatch.setattr(load_command("completion"), "run", fail)
    assert main(["completion", "bash"]) == status
    told = capsys.readouterr().err
    if said:
        assert told.startswith("drivelesson: ") and said in told and told.count("\n") == 1
    assert main(["completoin"]) == 2


def test_a_signal_that_comes_during_a_plugins_call_ends_the_program_without_an_error(
    monkeypatch, capsys
):
    def be_ended(args):
        before = signal.getsignal(signal.SIGTERM)
        end_by_signals()
        try:
            with PluginErrors("camera", "sim", CameraError).named("start"):
                signal.raise_signal(signal.SIGTERM)
        finally:
            signal.signal(signal.SIGTERM, before)

    monkeypatch.setattr(load_command("completion"), "run", be_ended)
    assert main(["completion", "bash"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("module", ["server.cli.main", "server.cli.parser"])
def test_ctrl_c_while_the_modules_are_imported_prints_no_traceback(module, monkeypatch, capsys):
    class Interrupting:
        def find_spec(self, name, path=None, target=None):
            if name == module:
                signal.raise_signal(signal.SIGINT)

    for name in ("server.cli.main", "server.cli.parser"):
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a background process
    try:
        assert start(["--version"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr() == ("", "")


def test_a_reader_that_ends_early_is_not_an_error():
    """`drivelesson --help | head -1` ends its reader early. The text is longer than Python's
    buffer."""
    printing = "import sys; from server.__main__ import main; "
    printing += "sys.exit(max(main(['--help']) for _ in range(8)))"
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        streams = {"capture_output": False, "stdout": pipe, "stderr": subprocess.PIPE}
        done = run(sys.executable, "-c", printing, **streams)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_starting_page_is_shown_before_fastapi_is_imported():
    """Importing FastAPI and the routes takes most of the CPU time of a start."""
    program = """
import sys
from server.cli.main import make_parser
make_parser("serve", ["--robot", "sim"]).parse_args(["--class-key", "x", "--keep-drives"])
import robot.devices.rig, server.hosting.starting_page
print("numpy" in sys.modules, "fastapi" in sys.modules)
"""
    done = run(sys.executable, "-c", program)
    assert done.stdout.split() == ["True", "False"], done.stderr


def test_a_plugin_may_have_a_module_named_options_that_declares_none(tmp_path, monkeypatch, capsys):
    """`drivelesson serve` imports the module `options` of each extension's package."""
    for name, text in {
        "lamp/__init__.py": "",
        "lamp/options.py": "BRIGHTNESS = 0.5\n",
        "lamp-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: lamp\nVersion: 1\n",
        "lamp-1.dist-info/entry_points.txt": "[drivelesson.services]\nlamp = lamp.routes:Lamp\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert "lamp" in {point.name for point in points(EXTENSIONS)}
    with pytest.raises(SystemExit, match="0"):
        main(["serve", "--help"])
    assert "--class-key" in capsys.readouterr().out
    for name in ("lamp", "lamp.options"):
        del sys.modules[name]


def test_the_overview_and_the_completion_name_every_command(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(f"  {name} " in said for name in commands())
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    for name in (*commands(), "--hostname"):
        assert name in script, f"{name} is not completed"


@pytest.mark.parametrize(
    "words",
    [
        "learn last --out m",
        "episodes compact last",
        "episodes title last x",
        "episodes export last --as folder",
        "episodes import OUT/mine --name again",
    ],
)
def test_a_full_disk_is_reported_in_a_sentence_and_nothing_is_lost(
    episode_id, data, tmp_path, words, monkeypatch, say
):
    say(f"episodes export last --as folder --out {tmp_path}/mine")
    before = {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()}

    def refuse(self, *_):
        raise OSError(28, "No space left on device")

    for name in ("robot.store.folder.os.fsync", "robot.exchange.files._write"):
        monkeypatch.setattr(name, refuse)
    told = say(words.replace("OUT", str(tmp_path)), status=1)
    assert told.splitlines()[-1].endswith("No space left on device")
    assert "Traceback" not in told
    assert {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()} == before
