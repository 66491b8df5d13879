"""What is wrong with a brick, and what to do: judges what was measured of it. Pure."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

WHEEL_TOLERANCE = 0.25
"""A wheel's speed may be so far from what was asked: a weak battery, friction."""


class Level(StrEnum):
    """How bad a finding is."""

    OK = "ok"
    NOTE = "note"
    WRONG = "WRONG"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report; `advice` says what to do, and is empty where all is well."""

    level: Level
    topic: str
    text: str
    advice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelTurn:
    """One part of the wheel test: what each wheel was told and what it did, in degrees a second."""

    asked_dps: tuple[float, float]
    turned_dps: tuple[float, float]
    is_stalled: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureArrival:
    """One picture as it came: when, how old, and what it is, on this machine's clock."""

    at_s: float
    age_s: float
    size: tuple[int, int]
    encoding: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BrickFacts:
    """All that was measured. `inspected` is the agent's answer to `inspect`."""

    address: str
    ports: tuple[str, str]
    release: str
    inspected: dict[str, Any]
    round_trips_s: Sequence[float]
    clock_ahead_s: float
    body_fault: str | None = None
    pictures: Sequence[PictureArrival] = ()
    camera_fault: str | None = None
    wheels: Sequence[WheelTurn] | None = field(default=None)


def examine(facts: BrickFacts) -> list[Finding]:
    """Return the findings, topic by topic; always at least one for each topic."""
    parts = (_versions, _line, _clock, _ports, _wheels, _sensors, _battery, _room, _camera)
    return [finding for part in parts for finding in part(facts)]


def write_report(findings: Sequence[Finding]) -> str:
    """Return the report as text that can be pasted into an issue."""
    lines = [f"{one.level:5}  {one.topic:8}  {one.text}" for one in findings]
    advice = [one for one in findings if one.advice]
    lines += ["", "What to do:" if advice else "All is well."]
    lines += [f"  {one.topic}: {one.advice}" for one in advice]
    return "\n".join(lines)


def _host(facts: BrickFacts) -> str:
    return facts.address.partition(":")[0]


def _versions(facts: BrickFacts) -> Iterator[Finding]:
    there = facts.inspected
    text = (
        f"agent {there['release']}, Python {there['python']}, Linux {there['kernel']} "
        f"on {there['machine']}"
    )
    if there["release"] == facts.release:
        yield Finding(Level.OK, "versions", text)
    else:
        renew = f"the agent is another than this program's; drivelesson brick agent {_host(facts)}"
        yield Finding(Level.NOTE, "versions", text, renew)


def _line(facts: BrickFacts) -> Iterator[Finding]:
    usual, worst = statistics.median(facts.round_trips_s), max(facts.round_trips_s)
    text = (
        f"round trip {1000 * usual:.0f} ms, worst {1000 * worst:.0f} of {len(facts.round_trips_s)}"
    )
    nearer = (
        "weak Wi-Fi: bring brick and access point nearer, try another channel or dongle, and keep "
        "large downloads out of this network"
    )
    if usual > 0.1:
        yield Finding(Level.WRONG, "wi-fi", text, nearer)
    elif usual > 0.04 or worst > 0.3:
        yield Finding(Level.NOTE, "wi-fi", text, nearer)
    else:
        yield Finding(Level.OK, "wi-fi", text)


def _clock(facts: BrickFacts) -> Iterator[Finding]:
    ahead_s = facts.clock_ahead_s
    if abs(ahead_s) < 60:
        yield Finding(Level.OK, "clock", "as on this computer, to the minute")
    else:
        way = "ahead of" if ahead_s > 0 else "behind"
        yield Finding(
            Level.NOTE,
            "clock",
            f"{abs(ahead_s) / 3600:.1f} hours {way} this computer",
            "a brick has no clock of its own; driving does not need it. For dates in its logs: "
            "connect it to the internet, or on the brick: sudo date -s '2026-01-31 12:00'",
        )


def _ports(facts: BrickFacts) -> Iterator[Finding]:
    motors = facts.inspected["motors"]
    listed = ", ".join(f"{one['driver_name']} at {one['address']}" for one in motors)
    if facts.body_fault is not None:
        yield Finding(
            Level.WRONG, "motors", listed or "none found", facts.body_fault.partition(": ")[2]
        )
    else:
        yield Finding(Level.OK, "motors", listed)


def _wheels(facts: BrickFacts) -> Iterator[Finding]:
    if facts.wheels is None:
        yield Finding(Level.NOTE, "wheels", "not tested")
        return
    faults = list(dict.fromkeys(fault for turn in facts.wheels for fault in _faults(facts, turn)))
    for text, advice in faults:
        yield Finding(Level.WRONG, "wheels", text, advice)
    if not faults:
        yield Finding(Level.OK, "wheels", "each turned and stopped as commanded")


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
                    "does another program drive it? Restart the brick",
                )
        elif turn.is_stalled[index] or abs(turned) < 0.1 * abs(asked):
            yield (
                f"{where} did not turn when it was driven",
                "turn it by hand: does something hold it fast? Then check the gears and the cable",
            )
        elif turned * asked < 0:
            yield f"{where} turned backward", "serve with --reversed-motors yes"
        elif abs(turned / asked - 1) > WHEEL_TOLERANCE:
            yield (
                f"{where} made {turned:.0f} degrees a second in place of {asked:.0f}",
                "charge the battery; check that nothing drags on the wheel",
            )


def _sensors(facts: BrickFacts) -> Iterator[Finding]:
    found = facts.inspected["sensors"]
    listed = ", ".join(f"{one['driver_name']} at {one['address']}" for one in found)
    if listed:
        yield Finding(Level.OK, "sensors", listed)
    else:
        yield Finding(
            Level.NOTE,
            "sensors",
            "none found",
            "the robot drives without; an ultrasonic and two touch sensors are welcome at any port",
        )


def _battery(facts: BrickFacts) -> Iterator[Finding]:
    volts = facts.inspected["battery_v"]
    if volts is None:
        yield Finding(Level.NOTE, "battery", "cannot be read")
        return
    text = f"{volts:.1f} V"
    if volts < 6.5:
        yield Finding(
            Level.WRONG, "battery", text, "charge it: the brick switches itself off at 6 V"
        )
    elif volts < 7.0:
        yield Finding(Level.NOTE, "battery", text, "charge it soon: motors get slower below 7 V")
    else:
        yield Finding(Level.OK, "battery", text)


def _room(facts: BrickFacts) -> Iterator[Finding]:
    memory_mb, card_mb = facts.inspected["memory_mb"], facts.inspected["card_mb"]
    if memory_mb is None:
        yield Finding(Level.NOTE, "memory", "cannot be read")
    elif memory_mb < 10:
        advice = "end other programs on the brick, or restart it"
        yield Finding(Level.WRONG, "memory", f"{memory_mb:.0f} MB free", advice)
    else:
        yield Finding(Level.OK, "memory", f"{memory_mb:.0f} MB free")
    if card_mb < 50:
        advice = "delete what you do not need on the brick, or take a larger card"
        yield Finding(Level.WRONG, "card", f"{card_mb:.0f} MB free", advice)
    else:
        yield Finding(Level.OK, "card", f"more than {50 if card_mb < 500 else 500} MB free")


def _camera(facts: BrickFacts) -> Iterator[Finding]:
    cameras = facts.inspected["cameras"]
    if not cameras:
        yield Finding(
            Level.WRONG,
            "camera",
            "none found",
            "plug it in, and wait ten seconds; if `lsusb` on the brick lists it, unplug it and "
            "plug it in again with the brick running (docs/howto/ev3.md, ev3dev#1546)",
        )
        return
    for one in cameras:
        yield from _offers(one)
    if not facts.pictures:
        fault = facts.camera_fault or "no pictures came"
        yield Finding(Level.WRONG, "pictures", fault, "try another cable or hub, or another camera")
        return
    yield from _pictures(facts.pictures)


def _offers(camera: dict[str, Any]) -> Iterator[Finding]:
    if "fault" in camera:
        yield Finding(Level.WRONG, "camera", camera["fault"], "unplug it and plug it in again")
        return
    offers = camera["offers"]
    text = camera["device"] + ": " + "; ".join(f"{k} {', '.join(v)}" for k, v in offers.items())
    if not offers:
        return  # the second device of a camera, which gives no pictures
    if "YUYV" not in offers:
        advice = "serve beside the brick, not on it: the brick cannot read MJPEG"
        yield Finding(Level.NOTE, "camera", text, advice)
    elif "160x120" not in offers["YUYV"]:
        advice = "pictures come more slowly: the brick's bus carries ten of 160x120 a second"
        yield Finding(Level.NOTE, "camera", text, advice)
    else:
        yield Finding(Level.OK, "camera", text)


def _pictures(pictures: Sequence[PictureArrival]) -> Iterator[Finding]:
    ages = sorted(one.age_s for one in pictures)
    usual, old = statistics.median(ages), ages[int(0.95 * (len(ages) - 1))]
    span_s = pictures[-1].at_s - pictures[0].at_s
    rate_hz = (len(pictures) - 1) / span_s if span_s > 0 else 0.0
    width, height = pictures[-1].size
    text = (
        f"{rate_hz:.1f} a second, {1000 * usual:.0f} ms old, 19 of 20 under {1000 * old:.0f}; "
        f"{width}x{height} {pictures[-1].encoding}"
    )
    if usual > 0.3:
        advice = "too old to drive at speed; look at the Wi-Fi and the camera's cable first"
        yield Finding(Level.WRONG, "pictures", text, advice)
    elif usual > 0.18 or rate_hz < 7:
        advice = "the robot will slow down; is the hub shared with more than camera and Wi-Fi?"
        yield Finding(Level.NOTE, "pictures", text, advice)
    else:
        yield Finding(Level.OK, "pictures", text)
