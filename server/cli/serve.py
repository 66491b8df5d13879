"""Drive a robot from the browser."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import logging
import os
import sys
import threading
import webbrowser
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot.control.config import CameraTimingConfig, GateConfig, LinkGovernorConfig, LoopConfig
from robot.devices.options import options_of
from robot.devices.plugins import (
    camera_names,
    default_driver,
    driver_names,
    load_camera,
    load_driver,
)
from robot.entry_points import EXTENSIONS, points
from robot.errors import ConfigurationError, PluginError, RecordingError, reason
from robot.policy.registry import MOST_NODES, full_name, split_name
from robot.store.disk import Announce
from robot.store.folder import Storage, default_root
from robot.store.prepare import prepare
from server.cli.parser import Parser, declare, number, whole
from server.cli.settings import PREFIX, Settings, apply_to, build, read_settings
from server.config import Config
from server.gateway.gateway import Gateway, gateway_type
from server.hosting.logs import start_logging
from server.hosting.serving import end_by_signals, open_sockets, serve
from server.hosting.starting_page import StartingPage, StartingPart

if TYPE_CHECKING:
    from robot.devices.rig import Rig
    from robot.store.models.autosave import Autosave
    from server.persistence import Persistence
    from server.services import Services

log = logging.getLogger(__name__)


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    default = default_driver()
    text = f"the robot: one of {', '.join(driver_names())}{shown if default else ''}"
    add("--robot", default=default, help=text)
    text = "the camera (default: the robot's own); one of "
    add("--camera", help=text + ", ".join(camera_names()))
    add("--learner", help="learner: KIND or KIND-NUMBER, such as default-64 (default: default)")
    number_of_nodes = whole(1, MOST_NODES, or_word="auto")
    text = (
        "maximum number of images that the learner stores (default: 32); auto: as many as this "
        "computer can compare at --rate"
    )
    add("--max-nodes", type=number_of_nodes, metavar="N", help=text)
    text = f"frame rate that --max-nodes auto must reach{shown}"
    add("--rate", type=number(above=0), default=14.0, metavar="HZ", help=text)
    add("--host", help="address to serve on (default: 127.0.0.1)")
    add("--port", type=whole(0, 65535), default=8000, help=f"port to serve on{shown}")
    gateway_type().configure(parser)
    add(
        "--data",
        type=Path,
        default=default_root(),
        help=f"data folder: models, recordings and settings{shown}",
    )
    add("--model", metavar="NAME", help="use this model; a new name begins a new model")
    add("--name", help="the robot's name (default: a name that the robot chooses)")
    text = f"JPEG quality of pictures that the camera does not deliver as JPEG{shown}"
    add("--jpeg-quality", type=whole(1, 100), default=75, help=text)
    add("--no-page", action="store_true", help="do not open the page in this machine's browser")
    add("--config", type=Path, help="TOML file with settings")
    packages = (point.module.rpartition(".")[0] for point in points(EXTENSIONS))
    for package in filter(None, dict.fromkeys(packages)):  # the extensions are imported later
        if find_spec(name := f"{package}.options"):  # may be a module without `configure`
            getattr(importlib.import_module(name), "configure", lambda _: None)(parser)
    add("-v", "--verbose", action="store_true", help="log more")


def extend(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Declare the options of the chosen robot and camera, and take defaults from the settings."""
    first = Parser(prog=parser.prog, add_help=False)
    for flag in ("--robot", "--camera", "--config"):
        first.add_argument(flag)
    chosen, _ = first.parse_known_args(list(words))
    file = chosen.config or os.environ.get(PREFIX + "CONFIG")
    settings = read_settings(Path(file) if file else None, os.environ)
    kinds: list[tuple[str, Any]] = []
    if robot := chosen.robot or settings.get("robot") or default_driver():
        driver_type = load_driver(str(robot))
        camera_name = chosen.camera or settings.get("camera") or driver_type.default_camera
        kinds = [("robot", driver_type), ("camera", load_camera(str(camera_name)))]
    ours = {action.dest for action in parser._actions}
    declared = {"jpeg_quality"}  # `serve` declares this camera option itself
    for title, kind in kinds:
        group = parser.add_argument_group(f"options of the {title} {kind.name}")
        for option in options_of(kind.options_type):
            if option.name in declared:  # a robot and its camera may share options
                continue
            if option.name in ours:
                text = f"the {title} {kind.name!r} declares {option.flag}, which is an option of "
                raise PluginError(text + "drivelesson serve: the plugin must rename its option")
            declared.add(option.name)
            declare(group, option)
    apply_to(parser, settings)
    parser.set_defaults(settings=settings)


def run(args: argparse.Namespace) -> int:
    from robot.devices.rig import build_rig

    if args.robot is None:
        known = ", ".join(driver_names())
        raise ConfigurationError(f"choose a robot with --robot NAME: one of {known}")
    start_logging(verbose=args.verbose)
    if os.name == "posix":  # recordings show rooms, so other accounts may not read them
        os.umask(0o077)
    config, loop = _make_config(args), _make_loop_config(args.settings)
    learner, given = _name_learner(args), vars(args)
    rig = build_rig(args.robot, camera=args.camera, learner=learner, options=given, config=loop)
    listeners = open_sockets(config.host, config.port)
    config = dataclasses.replace(config, port=listeners[0].getsockname()[1])
    gateway = gateway_type()(config, rig.clock)
    end_by_signals()
    with StartingPage([] if gateway.is_tls else listeners, rig.clock) as starting:
        from server.app import create_app  # takes a second, during which the starting page is shown

        kept, services = _make_services(args, rig, gateway)

        def greet_more() -> list[str]:
            return [line for each in services.extensions.values() for line in each.greet()]

        with gateway.serving(greet_more):
            gateway.open(services.identity.now.name, rig.driver.announce)
            app, starting.part = create_app(services), StartingPart.ROBOT
            with rig, kept:
                starting.part = StartingPart.MODEL
                for extension in services.extensions.values():
                    extension.prepare()
                _choose_model(kept.autosave, args, learner)
                starting.stop()
                print(gateway.greet(greet_more()), flush=True)
                if gateway.admits_all and not args.no_page and sys.stdout.isatty():
                    show_page(gateway.addresses()[0])
                serve(app, listeners)
    return 0


def _make_services(
    args: argparse.Namespace, rig: Rig, gateway: Gateway
) -> tuple[Persistence, Services]:
    from server.clients.hub import Hub
    from server.identity import IdentityFile
    from server.persistence import Persistence
    from server.services import Services

    config, given = gateway.config, vars(args)
    moved = prepare(config.data)
    storage = Storage(config.data, must_be_usable=False)
    identity = IdentityFile(config.data, args.name)
    hub = Hub(config, rig, identity)
    name, used, announce = identity.now.name, _recorded(args, rig), hub.broadcast.announce
    kept = Persistence(storage, rig, name=name, options=used, announce=announce, settings=given)
    _report_problems(moved, storage.fault, announce)
    return kept, Services(config, rig, hub=hub, persistence=kept, gateway=gateway, options=given)


def _report_problems(moved: list[tuple[str, str]], fault: str | None, announce: Announce) -> None:
    """Report a storage fault, or damaged files that were set aside, on the page and in the log."""
    if moved:
        sentence = ", ".join(f"{name} -> {where}" for name, where in moved)
        log.warning("set aside in the data folder: %s", sentence)
        announce("set_aside", detail=sentence)
    if fault:
        log.warning("nothing can be saved: %s", fault)
        announce("nothing_kept", detail=fault)


def _recorded(args: argparse.Namespace, rig: Rig) -> dict[str, str]:
    """Return the options that each recording contains; secrets are left out."""
    kinds = (rig.driver.options_type, rig.camera.options_type)
    secret = {one.name for kind in kinds for one in options_of(kind) if one.is_secret}
    return {
        name: str(value)
        for name, value in vars(args).items()
        if name not in secret
        and isinstance(value, str | int | float | Path)
        and value not in ("", False)
    }


def _name_learner(args: argparse.Namespace) -> str:
    """Return the learner's name; with `--max-nodes auto`, measure this machine first."""
    learner = args.learner or "default"
    if args.max_nodes != "auto":
        return full_name(learner, args.max_nodes, 32)
    from robot.policy.autosize import choose_max_nodes

    cost = choose_max_nodes(args.rate, kind=split_name(full_name(learner, None, 32))[0])
    print(
        f"This machine sustains {args.rate:g} frames a second with {cost.max_nodes} images "
        f"({1000 * cost.frame_s:.1f} ms a frame).",
        flush=True,
    )
    return full_name(learner, cost.max_nodes, None)


def _choose_model(autosave: Autosave, args: argparse.Namespace, learner: str) -> None:
    """Load the model that was asked for, or else the last good model of this learner."""
    if args.model is None:
        autosave.load_last(learner if args.learner or args.max_nodes else None)
        return
    try:
        if args.model in autosave.store.names():
            autosave.load(args.model)
        else:
            autosave.begin(args.model)
    except (OSError, RecordingError) as error:  # the robot starts without this model
        log.warning("the model %s is not in use: %s", args.model, error)
        autosave.announce("model_not_saved", detail=reason(error))


def _make_config(args: argparse.Namespace) -> Config:
    kind = gateway_type()
    return kind.make_config(
        args,
        port=args.port,
        data=args.data,
        jpeg_quality=args.jpeg_quality,
        limits=build(kind.limits_type, args.settings.tables.get("limits", {}), "limits"),
    )


def _make_loop_config(settings: Settings) -> LoopConfig:
    return LoopConfig(
        gate=build(GateConfig, settings.tables.get("gate", {}), "gate"),
        governor=build(LinkGovernorConfig, settings.tables.get("governor", {}), "governor"),
        camera=build(CameraTimingConfig, settings.tables.get("patience", {}), "patience"),
    )


def has_screen(system: str, environment: Mapping[str, str]) -> bool:
    """True if a browser can open a window; a text browser would take over the terminal."""
    if "SSH_CONNECTION" in environment:  # the person sits at another machine
        return False
    has_display = bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
    return system in ("win32", "darwin") or has_display


def show_page(address: str) -> None:
    """Open the address in the browser; return before the browser has started."""
    if has_screen(sys.platform, os.environ):
        threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
