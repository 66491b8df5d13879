"""Judges the measurements of a brick: finds faults, and gives advice. Pure."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

from robot.bodies.ev3.link import RemotePicture

WHEEL_TOLERANCE = 0.25
"""Maximum relative error of a wheel's speed. A weak battery or friction slows it."""
Advice = str | Literal[False]


class Level(StrEnum):
    """The severity of a finding."""

    OK = "ok"
    NOTE = "note"
    WRONG = "WRONG"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report. `advice` says what to do; it is empty if nothing is wrong."""

    level: Level
    topic: str
    text: str
    advice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelTurn:
    """The result of one part of the wheel test: each wheel's commanded and measured speed, in
    degrees/s."""

    asked_dps: Sequence[float]
    turned_dps: Sequence[float]
    is_stalled: Sequence[bool] = (False, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class BrickFacts:
    """All measurements of a brick. `inspected` is the agent's answer to the command `inspect`."""

    address: str
    ports: tuple[str, str]
    release: str
    inspected: dict[str, Any]
    round_trips_s: Sequence[float]
    clock_ahead_s: float
    body_fault: str | None = None
    pictures: Sequence[RemotePicture] = ()
    camera_fault: str | None = None
    wheels: Sequence[WheelTurn] | None = None


def examine(facts: BrickFacts) -> list[Finding]:
    """Return the findings by topic, at least one for each topic."""
    parts = (_versions, _line, _clock, _ports, _wheels, _sensors, _battery, _room, _camera)
    return [finding for part in parts for finding in part(facts)]


def write_report(findings: Sequence[Finding]) -> str:
    """Return the report as text that can be pasted into an issue."""
    lines = [f"{one.level:5}  {one.topic:8}  {one.text}" for one in findings]
    advice = [one for one in findings if one.advice]
    lines += ["", "What to do:" if advice else "All is well."]
    lines += [f"  {one.topic}: {one.advice}" for one in advice]
    return "\n".join(lines)


def _judge(topic: str, text: str, *, wrong: Advice = False, note: Advice = False) -> Finding:
    """Return a finding: an error if `wrong` contains advice, a note if `note` does, and otherwise
    OK."""
    level = Level.WRONG if wrong else Level.NOTE if note else Level.OK
    return Finding(level, topic, text, wrong or note or "")


def _versions(facts: BrickFacts) -> Iterator[Finding]:
    there, host = facts.inspected, facts.address.partition(":")[0]
    yield _judge(
        "versions",
        f"agent {there['release']}, Python {there['python']}, Linux {there['kernel']} "
        f"on {there['machine']}",
        note=there["release"] != facts.release
        and "the agent's version differs from this program's; update it: drivelesson brick agent "
        f"{host}",
    )


def _line(facts: BrickFacts) -> Iterator[Finding]:
    usual, worst = statistics.median(facts.round_trips_s), max(facts.round_trips_s)
    nearer = (
        "weak Wi-Fi: move brick and access point closer, try another channel or dongle, and keep "
        "large downloads out of this network"
    )
    yield _judge(
        "wi-fi",
        f"round trip {1000 * usual:.0f} ms; the longest of {len(facts.round_trips_s)} took "
        f"{1000 * worst:.0f} ms",
        wrong=usual > 0.1 and nearer,
        note=(usual > 0.04 or worst > 0.3) and nearer,
    )


def _clock(facts: BrickFacts) -> Iterator[Finding]:
    hours = facts.clock_ahead_s / 3600
    if abs(hours) < 1 / 60:
        yield _judge("clock", "within a minute of this computer's clock")
        return
    yield _judge(
        "clock",
        f"{abs(hours):.1f} hours {'ahead of' if hours > 0 else 'behind'} this computer",
        note="driving does not need the right time; to get right dates in logs, connect the brick "
        "to the internet, or run on it: sudo date -s '2026-01-31 12:00'",
    )


def _ports(facts: BrickFacts) -> Iterator[Finding]:
    fault = facts.body_fault
    listed = _listed(facts.inspected["motors"])
    advice = fault is not None and (fault.partition(": ")[2] or fault)
    yield _judge("motors", listed, wrong=advice)


def _listed(devices: Sequence[dict[str, str]]) -> str:
    found = ", ".join(f"{one['driver_name']} at {one['address']}" for one in devices)
    return found or "none found"


def _wheels(facts: BrickFacts) -> Iterator[Finding]:
    if facts.wheels is None:
        yield Finding(Level.NOTE, "wheels", "not tested")
        return
    faults = dict.fromkeys(fault for turn in facts.wheels for fault in _faults(facts, turn))
    for text, advice in faults:
        yield _judge("wheels", text, wrong=advice)
    if not faults:
        yield _judge("wheels", "each turned and stopped as commanded")


def _faults(facts: BrickFacts, turn: WheelTurn) -> Iterator[tuple[str, str]]:
    turns = [abs(dps) > 20 for dps in turn.turned_dps]
    asked_for = [dps != 0 for dps in turn.asked_dps]
    if sum(asked_for) == 1 and turns == asked_for[::-1]:
        left, right = facts.ports
        yield (
            f"the motors at {left} and {right} are swapped",
            f"swap their cables, or serve with --left-port {right} --right-port {left}",
        )
        return
    for index, side in enumerate(("left", "right")):
        asked, turned, port = turn.asked_dps[index], turn.turned_dps[index], facts.ports[index]
        where = f"the {side} wheel ({port})"
        if asked == 0:
            if abs(turned) > 20:
                yield (
                    f"{where} turned although it was stopped",
                    "another program may drive it; restart the brick",
                )
        elif turn.is_stalled[index] or abs(turned) < 0.1 * abs(asked):
            yield (
                f"{where} did not turn when it was driven",
                "turn it by hand: is it blocked? Then check the gears and the cable",
            )
        elif turned * asked < 0:
            yield f"{where} turned backward", "serve with --reversed-motors yes"
        elif abs(turned / asked - 1) > WHEEL_TOLERANCE:
            yield (
                f"{where} made {turned:.0f} degrees a second instead of {asked:.0f}",
                "charge the battery; check that nothing drags on the wheel",
            )


def _sensors(facts: BrickFacts) -> Iterator[Finding]:
    found = facts.inspected["sensors"]
    welcome = (
        "the robot can drive without sensors, but can use an ultrasonic and two touch sensors, at "
        "any port"
    )
    yield _judge("sensors", _listed(found), note=not found and welcome)


def _battery(facts: BrickFacts) -> Iterator[Finding]:
    volts = facts.inspected["battery_v"]
    if volts is None:
        yield Finding(Level.NOTE, "battery", "cannot be read")
        return
    yield _judge(
        "battery",
        f"{volts:.1f} V",
        wrong=volts < 6.5 and "charge it: the brick switches itself off at 6 V",
        note=volts < 7.0 and "charge it soon: motors get slower below 7 V",
    )


def _room(facts: BrickFacts) -> Iterator[Finding]:
    memory_mb, card_mb = facts.inspected["memory_mb"], facts.inspected["card_mb"]
    if memory_mb is None:
        yield Finding(Level.NOTE, "memory", "cannot be read")
    else:
        advice = memory_mb < 10 and "end other programs on the brick, or restart it"
        yield _judge("memory", f"{memory_mb:.0f} MB free", wrong=advice)
    free = f"{card_mb:.0f}" if card_mb < 50 else f"more than {50 if card_mb < 500 else 500}"
    advice = card_mb < 50 and "delete what you do not need on the brick, or take a larger card"
    yield _judge("card", f"{free} MB free", wrong=advice)


def _camera(facts: BrickFacts) -> Iterator[Finding]:
    cameras = facts.inspected["cameras"]
    if not cameras:
        yield _judge(
            "camera",
            "none found",
            wrong="plug it in, and wait ten seconds; if `lsusb` on the brick lists it, unplug it "
            "and plug it in again with the brick running (docs/howto/ev3.md, ev3dev#1546)",
        )
        return
    for one in cameras:
        yield from _offers(one)
    if facts.pictures:
        yield _pictures(facts.pictures)
    else:
        fault = facts.camera_fault or "no pictures came"
        yield _judge("pictures", fault, wrong="try another cable or hub, or another camera")


def _offers(camera: dict[str, Any]) -> Iterator[Finding]:
    if "fault" in camera:
        yield _judge("camera", camera["fault"], wrong="unplug it and plug it in again")
    elif offers := camera["offers"]:  # a camera may have a second device, which offers no pictures
        text = "; ".join(f"{kind} {', '.join(sizes)}" for kind, sizes in offers.items())
        advice = (
            "YUYV" not in offers
            and "run the server on another computer, not on the brick, which cannot read MJPEG"
        ) or (
            "160x120" not in offers.get("YUYV", ())
            and "expect a lower frame rate: the brick's USB bus can carry only ten pictures of "
            "160x120 a second"
        )
        yield _judge("camera", f"{camera['device']}: {text}", note=advice)


def _pictures(pictures: Sequence[RemotePicture]) -> Finding:
    ages = sorted(one.came_s - one.taken_s for one in pictures)
    usual, old = statistics.median(ages), ages[int(0.95 * (len(ages) - 1))]
    last = pictures[-1]
    span_s = last.came_s - pictures[0].came_s
    rate_hz = (len(pictures) - 1) / span_s if span_s > 0 else 0.0
    return _judge(
        "pictures",
        f"{rate_hz:.1f} a second, {1000 * usual:.0f} ms old (95 % under {1000 * old:.0f} ms); "
        f"{last.width}x{last.height} {last.encoding}",
        wrong=usual > 0.3
        and "too old to drive at speed; check the Wi-Fi and the camera's cable first",
        note=(usual > 0.18 or rate_hz < 7)
        and "the robot will slow down; is anything besides camera and Wi-Fi on the USB hub?",
    )
