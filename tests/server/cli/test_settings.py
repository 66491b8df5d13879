"""The sources of settings, the values that are refused, and the reference that lists them all."""

import argparse
import os
import re
import sys
from dataclasses import fields, make_dataclass
from itertools import product
from pathlib import Path

import pytest

from robot.control.config import CameraTimingConfig, GateConfig, LinkGovernorConfig
from robot.errors import ConfigurationError, PluginError
from robot.store.folder import default_root
from server.access.config import NetworkLimits
from server.app import ROUTERS
from server.cli import serve
from server.cli.main import main, make_parser
from server.cli.settings import apply_to, build, read_settings
from tests.kit.run import run

REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "reference"


def _parse(file: Path | None, environ: dict[str, str], *words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    serve.configure(parser)
    apply_to(parser, read_settings(file, environ))
    return parser.parse_args(words)


def test_flags_go_before_environment_before_file(tmp_path):
    file = tmp_path / "robot.toml"
    file.write_text('port = 8001\nhostname = "kitchen"\nlan = true\njpeg-quality = 70\n')
    environ = {"DRIVELESSON_PORT": "8002", "DRIVELESSON_HOSTNAME": "hall"}
    args = _parse(file, environ, "--port", "8003")
    assert (args.port, args.hostname, args.lan, args.jpeg_quality) == (8003, "hall", True, 70)
    assert _parse(file, {"DRIVELESSON_LAN": "no"}).lan is False
    assert _parse(file, {}).port == 8001


def test_a_file_is_utf_8_on_every_system(tmp_path):
    cases = list(product(("utf-8", "utf-8-sig"), ("\n", "\r\n"), ("Müller", "李", "\ufeff")))
    for number, (encoding, end, name) in enumerate(cases):
        file = tmp_path / f"{number:02}.toml"
        file.write_bytes(f'name = "{name}"{end}port = 8001{end}'.encode(encoding))
        assert read_settings(file, {}).flags == {"name": name, "port": 8001}, cases[number]
    # A C locale without UTF-8 mode simulates Windows, where Python's default encoding differs.
    program = f"""
from pathlib import Path
from server.cli.settings import read_settings
for file in sorted(Path({str(tmp_path)!r}).iterdir()):
    print(ascii(read_settings(file, {{}}).flags["name"]))
"""
    environ = {**os.environ, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    done = run(sys.executable, "-X", "utf8=0", "-c", program, env=environ)
    assert done.stdout.split() == [ascii(name) for _, _, name in cases], done.stderr


def test_a_file_that_is_missing_or_in_another_encoding_is_refused_by_its_name(tmp_path):
    file = tmp_path / "robot.toml"
    with pytest.raises(ConfigurationError, match=r"cannot read .*robot\.toml"):
        read_settings(file, {})
    file.write_bytes('name = "Müller"'.encode("cp1252"))
    with pytest.raises(ConfigurationError, match=r"robot.toml is not valid TOML: 'utf-8'.*0xfc"):
        read_settings(file, {})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("prot = 1", "unknown setting prot"),
        ("port = [1]", "port must be text or a number"),
        ("lan = 'perhaps'", "lan must be true or false"),
        ("port = ", "is not valid TOML"),
        ("port = " + "[" * 20_000, "is not valid TOML"),
        ("gate = 3", "must be tables"),
    ],
    ids=lambda text: text[:30],
)
def test_a_broken_file_is_refused(tmp_path, text, said):
    file = tmp_path / "robot.toml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=said):
        _parse(file, {})


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("port", "abc", "must be a whole number from 0 to 65535, not 'abc'"),
        ("max_nodes", "0", "must be a whole number from 1 to 1024, or 'auto', not '0'"),
        ("lan", "maybe", "must be true or false, not 'maybe'"),
        ("hostname", "a.b", "at most 63 letters, digits and hyphens, without a dot, not 'a.b'"),
    ],
)
def test_an_impossible_value_is_refused_with_its_location(tmp_path, name, value, said):
    file = tmp_path / "robot.toml"
    file.write_text(f"{name} = {value!r}\n")
    with pytest.raises(ConfigurationError, match=re.escape(f"robot.toml: {name}") + ".*" + said):
        _parse(file, {})
    variable = f"DRIVELESSON_{name.upper()}"
    with pytest.raises(ConfigurationError, match=f"^{variable}.*{said}"):
        _parse(None, {variable: value})


@pytest.mark.parametrize("name", ["rate", "name", "port", "no_page"])
def test_a_plug_in_cannot_declare_an_option_of_the_server(monkeypatch, name):
    options = make_dataclass("PicturesOptions", [(name, str | None, None)])
    camera = type("Pictures", (), {"name": "pictures", "options_type": options})
    monkeypatch.setattr(serve, "load_camera", lambda _: camera)
    parser = argparse.ArgumentParser()
    serve.configure(parser)
    flag = "--" + name.replace("_", "-")
    with pytest.raises(PluginError, match=f"the camera 'pictures' declares {flag}, which is"):
        serve.extend(parser, ["--robot", "sim", "--camera", "pictures"])


def test_an_empty_folder_setting_means_the_default_and_not_the_current_folder(monkeypatch):
    for name in ("DATA", "CONFIG"):
        monkeypatch.setenv(f"DRIVELESSON_{name}", "")
    args = make_parser("serve").parse_args([])
    assert (args.data, args.config) == (default_root(), None) and args.data.is_absolute()


@pytest.mark.parametrize("words", ["--robot gpio", "--robot=gpio", "--rob gpio", "--ro=gpio"])
def test_a_robots_options_are_declared_however_its_flag_is_abbreviated(words):
    given = [*words.split(), "--servo-pin", "13"]
    args = make_parser("serve", given).parse_args(given)
    assert (args.robot, args.servo_pin) == ("gpio", "13")


@pytest.mark.parametrize(("name", "value"), [("robot", "5"), ("camera", "['sim']")])
def test_an_invalid_robot_name_is_refused_in_one_line(tmp_path, name, value, capsys):
    file = tmp_path / "robot.toml"
    file.write_text(f"{name} = {value}\n")
    assert main(["serve", "--config", str(file)]) == 2
    assert capsys.readouterr().err.startswith(f"drivelesson: unknown {name} ")


def test_a_table_changes_only_the_fields_that_it_names_and_a_broken_one_is_refused():
    assert build(LinkGovernorConfig, {"stop_s": 0.4}, "governor") == LinkGovernorConfig(stop_s=0.4)
    for kind, field, value, said in (
        (LinkGovernorConfig, "warn", 1, "unknown setting warn"),
        (LinkGovernorConfig, "warn_s", "soon", "must be a number"),
        (LinkGovernorConfig, "warn_s", -1, "must be a number of at least 0"),
        (LinkGovernorConfig, "warn_s", True, "must be a number"),
        (NetworkLimits, "clients", 1.5, "whole number"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            build(kind, {field: value}, "table")


def test_every_setting_is_in_the_reference():
    text = (REFERENCE / "configuration.md").read_text()
    parser = argparse.ArgumentParser(add_help=False)
    serve.configure(parser)
    flags = [action.option_strings[-1] for action in parser._actions]
    tables = [
        field.name
        for kind in (GateConfig, LinkGovernorConfig, CameraTimingConfig, NetworkLimits)
        for field in fields(kind)
    ]
    assert [name for name in flags + tables if f"`{name}`" not in text] == []


def test_every_address_is_in_the_reference():
    text = (REFERENCE / "http.md").read_text()
    paths = [getattr(route, "path", "") for router in ROUTERS for route in router.routes]
    ours = [path for path in paths if not path.startswith("/api/") or "pair" in path]
    assert [path for path in ours if path not in text] == []
