"""A screen reader's view of driving and editing: names, roles, states and their order."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from robot.types import Mode

from .class_world import running_class
from .hand import choose
from .test_everyone import complaints
from .world import World

pytestmark = pytest.mark.browser

CONTROLS = {"button", "link", "checkbox", "radio", "slider", "textbox", "combobox", "image"}
STATES = ("checked", "pressed", "expanded", "disabled")


class Node(NamedTuple):
    """One thing that is read out."""

    role: str
    name: str
    states: dict[str, Any]
    value: Any
    path: tuple[str, ...]
    """Its containers: role and name of each."""


def tree(page: Any) -> list[Node]:
    """Return Chromium's output for a screen reader, in its order."""
    session = page.context.new_cdp_session(page)
    nodes = {n["nodeId"]: n for n in session.send("Accessibility.getFullAXTree")["nodes"]}
    session.detach()
    [root] = [node for node in nodes.values() if "parentId" not in node]
    return list(_walk(root, nodes, ()))


def _walk(node: Any, nodes: dict[str, Any], path: tuple[str, ...]) -> Iterator[Node]:
    role, name = (node.get(part, {}).get("value", "") for part in ("role", "name"))
    if not node.get("ignored") and role not in ("generic", "none", "InlineTextBox", "StaticText"):
        properties = {p["name"]: p["value"].get("value") for p in node.get("properties", [])}
        states = {key: properties[key] for key in STATES if key in properties}
        yield Node(role, name, states, node.get("value", {}).get("value"), path)
        path = (*path, f"{role} {name}".strip())
    for child in node.get("childIds", []):
        if child in nodes:
            yield from _walk(nodes[child], nodes, path)


def find(nodes: list[Node], role: str, name: str = "") -> Node:
    found = [node for node in nodes if node.role == role and name in node.name]
    assert len(found) == 1, f"{role} {name!r}: {found}"
    return found[0]


def in_order(nodes: list[Node], *wanted: str) -> None:
    """Check that these are read in this order; each is the beginning of `role name`."""
    names = [f"{node.role} {node.name}" for node in nodes]
    at = -1
    for one in wanted:
        later = [i for i, name in enumerate(names) if i > at and name.startswith(one)]
        assert later, f"{one!r} is not read after {names[at] if at >= 0 else 'the start'}: {names}"
        at = later[0]


def sound(nodes: list[Node]) -> None:
    """Check the requirements of every screen."""
    assert [node for node in nodes if node.role in CONTROLS and not node.name.strip()] == []
    assert [node.role for node in nodes].count("main") == 1
    levels = [node for node in nodes if node.role == "heading"]
    assert levels and all(node.name.strip() for node in levels)
    stops = [node for node in nodes if node.role == "button" and node.name.startswith("STOP")]
    assert stops and not any(stop.states.get("disabled") for stop in stops)


def test_mending_is_read_out_with_times_and_states(rovers_desktop: Any, shelf: World) -> None:
    desktop = rovers_desktop
    shelf.persistence.autosave.save()
    desktop.evaluate("location.hash = 'home'")
    desktop.locator("button[aria-label*='20']").click()
    desktop.wait_for_selector(".timeline .you[d]")
    nodes = tree(desktop)
    sound(nodes)
    in_order(
        nodes,
        "banner",
        "link Back",
        "heading Models and recordings",
        "button STOP",
        "main",
        "heading What this robot knows",
        "heading Rover in use",
        "heading Recordings",
        "checkbox Select all",
        "status",
        "checkbox Select",
        "button More about",
        "group Recording",
        "image What you held",
        "button Play",
        "slider Time",
        "status",
        "slider From",
        "button From here",
        "slider To",
        "button To here",
        "button Keep only this",
        "button Leave this out",
        "button Split here",
        "group The robot should go here",
        "button Forward",
        "button Teach again",
        "button Delete",
    )
    assert [node for node in nodes if node.name == "Upload"] == [find(nodes, "button", "Upload")]
    for label in ("Time", "From", "To"):
        spoken = desktop.get_by_label(label, exact=True).get_attribute("aria-valuetext")
        assert spoken and " s" in spoken, f"{label} is read out in seconds, not in pictures"
    opened = [node for node in nodes if node.name.startswith("More about Nov") or "20" in node.name]
    assert any(node.states.get("expanded") for node in opened if node.role == "button")
    moves = [
        n
        for n in nodes
        if any(part.startswith("group The robot should go here") for part in n.path)
    ]
    assert [node.name for node in moves if node.role == "button"] == ["Forward", "Left"]


def test_driving_is_read_out_in_the_order_of_its_use(rovers_desktop: Any, rover: World) -> None:
    desktop, world = rovers_desktop, rover
    nodes = tree(desktop)
    sound(nodes)
    in_order(
        nodes,
        "banner",
        "heading Rover",
        "button Menu",
        "main",
        "image What the robot sees",
        "group What the robot would do",
        "status",
        "radiogroup Mode",
        "radio Stop",
        "radio Teach",
        "radio Drive itself",
        "group Hold to drive",
        "button Forward",
        "button Left",
        "button Right",
        "button STOP",
    )
    assert find(nodes, "radio", "Stop").states["checked"] == "true"
    choose(desktop, world, Mode.TRAIN)
    desktop.keyboard.down("ArrowLeft")
    desktop.locator("drive-pad [data-move=left][aria-pressed=true]").wait_for()
    nodes = tree(desktop)
    assert find(nodes, "radio", "Teach").states["checked"] == "true"
    assert find(nodes, "radio", "Stop").states["checked"] == "false"
    assert find(nodes, "button", "Left").states["pressed"] == "true"
    assert find(nodes, "button", "Forward").states["pressed"] == "false"
    desktop.keyboard.up("ArrowLeft")
    desktop.locator("drive-pad .stop").click()
    desktop.locator("mode-bar [data-mode=train][aria-disabled=true]").wait_for()
    nodes = tree(desktop)
    assert all(node.states.get("disabled") for node in nodes if node.role == "radio")
    assert any("status" in node.path for node in nodes if node.role == "button"), "the way on"


def test_a_class_is_read_out_robot_by_robot(
    chromium: Any, tmp_path: Path, npm_modules: Path
) -> None:
    axe = (npm_modules / "axe-core" / "axe.min.js").read_text()
    with running_class(tmp_path, 2, 1) as school:
        context = chromium.new_context()
        page = context.new_page()
        page.goto(school.address)
        page.locator(".robot[data-status=there]").nth(1).wait_for()
        nodes = tree(page)
        sound(nodes)
        in_order(
            nodes,
            "banner",
            "heading The class",
            "status",
            "radiogroup What to show",
            "button Class settings",
            "button STOP ALL",
            "main",
            "article Ada",
            "heading Ada",
            "button STOP Ada",
            "button More about Ada",
            "article Bolt",
            "button STOP Bolt",
            "article",
            "button STOP 127",
        )
        page.evaluate(axe)
        assert complaints(page) == []
        page.locator("button.stop").click()
        page.locator("#loud p").wait_for()
        find(tree(page), "alert")
        assert complaints(page) == [], "with a robot that was not reached"
        page.locator("[data-view=codes]").click()
        page.locator(".robot .code").nth(1).wait_for()
        find(tree(page), "image", "QR code that pairs a phone with Bolt")
        page.locator(".robot .acts button:last-child").first.click()
        assert complaints(page) == [], "with codes and a robot's panel"
        context.close()
