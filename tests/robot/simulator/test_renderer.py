"""The renderer keeps no memory of pictures or worlds, and threads do not disturb each other."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import pytest

from robot.simulator.renderer import Renderer
from robot.simulator.world import load_world
from robot.types import Pose

core = pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")


def pose(k: int) -> Pose:
    return Pose(x_m=0.5 + 0.2 * math.sin(0.11 * k), y_m=0.5, heading_rad=0.23 * k)


def pictures(seed: int, count: int = 60) -> list[bytes]:
    """Render from many poses, every tenth time also at twice the size."""
    world = load_world("push")
    renderer, found = Renderer(world, seed), []
    for k in range(count):
        found.append(renderer.render(pose(k), world.obstacles).tobytes())
        if k % 10 == 0:
            found.append(renderer.render_large().tobytes())
    renderer.close()
    return found


def test_a_picture_leaves_no_state_behind() -> None:
    """Before, each new pose leaked two to four transform states, 2.6 kB."""
    world = load_world("push")
    renderer = Renderer(world)

    def states_after(first: int, count: int) -> int:
        for k in range(first, first + count):
            renderer.render(pose(k), world.obstacles)
        return int(core.TransformState.getNumStates() + core.RenderState.getNumStates())

    before = states_after(0, 20)
    assert states_after(20, 200) - before < 10
    renderer.close()


def test_a_closed_world_is_freed_when_the_next_is_drawn() -> None:
    """Before, each world that was opened and closed leaked its floor, 1 MB."""
    first, second = Renderer(load_world("box")), Renderer(load_world("box"))
    first.render(pose(0))
    first.render_large()
    floor = first._root.findTexture("floor")
    assert floor.getRefCount() > 1
    first.close()
    first.close()
    second.render(pose(0))
    second.render_large()
    assert floor.getRefCount() == 1, "only this test has it"
    second.close()


def test_each_thread_draws_the_same_as_without_the_others() -> None:
    alone = [pictures(seed) for seed in range(4)]
    assert alone[0] != alone[1]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(pictures, range(4))) == alone
