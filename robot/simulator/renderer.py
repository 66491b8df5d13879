"""Renders the simulated camera's view with Panda3D's software renderer, without display or GPU.

All renderers of a process share one engine. A lock lets only one renderer draw at a time, so any
thread may use any renderer.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.driver import Pose
from robot.errors import need
from robot.simulator.world import Colour, Obstacle, World

WIDTH_PX, HEIGHT_PX = 160, 120
LARGE_WIDTH_PX, LARGE_HEIGHT_PX = 320, 240
CAMERA_HEIGHT_M = 0.14
CAMERA_FORWARD_M = 0.05
CAMERA_PITCH_DEG = -18.0
FIELD_OF_VIEW_DEG = (62.0, 48.5)

_Point = tuple[float, float, float]
_Quad = tuple[tuple[_Point, _Point, _Point, _Point], Colour]
_FLOOR_PX = 512
_FLOOR_ROWS = 16
"""Number of rows of the floor that are computed at the same time."""
_CYLINDER_SIDES = 16


_LOCK = threading.RLock()
"""Lock for all calls of Panda3D, which releases the GIL while it draws. Without the lock, two
threads could draw at the same time, and some pixels would be wrong by one grey level."""
_OWN_SETTINGS = """
notify-level error
audio-library-name null
garbage-collect-states 0
"""
"""Settings of Panda3D. Panda3D makes a new object, a transform state, for each pose. Panda3D would
collect unused states in a task of its application object, which this program does not use. With
`garbage-collect-states 0`, states are freed as soon as no object refers to them."""


class _Window:
    """A buffer of a fixed `size` (width, height), into which any camera's view is drawn."""

    def __init__(
        self, core: Any, engine: Any, pipe: Any, size: tuple[int, int], *shared: Any
    ) -> None:
        """Make the buffer; `shared` is the state of another window, if both are to use the same
        copies of textures."""
        properties = core.FrameBufferProperties()
        properties.setRgbColor(True)
        properties.setDepthBits(16)
        refuse = core.GraphicsPipe.BFRefuseWindow
        self._engine, self._size = engine, size
        self._buffer = engine.makeOutput(
            pipe, f"{size[0]} px", 0, properties, core.WindowProperties.size(*size), refuse, *shared
        )
        self.state = self._buffer.getGsg()
        self._texture = core.Texture()
        self._buffer.addRenderTexture(self._texture, core.GraphicsOutput.RTMCopyRam)
        self._region = self._buffer.makeDisplayRegion()
        engine.renderFrame()  # the first frame of a new window is empty, so draw once
        self._buffer.setActive(False)

    def draw(self, camera: Any) -> NDArray[np.uint8]:
        """Return the camera's view, shape (height, width, 3), RGB, rows from the top."""
        self._region.setCamera(camera)
        self._buffer.setActive(True)
        self._engine.renderFrame()
        self._buffer.setActive(False)
        width_px, height_px = self._size
        data = self._texture.getRamImageAs("RGB")
        return np.frombuffer(data, np.uint8).reshape(height_px, width_px, 3)[::-1].copy()

    def forget(self, camera: Any) -> None:
        """Release a camera and its world."""
        self._region.setCamera(camera)


class _Engine:
    """Panda3D in this process: the module, and a window for each picture size."""

    def __init__(self) -> None:
        self.core = need("panda3d.core", "the simulator", "sim")
        self.core.loadPrcFileData("", _OWN_SETTINGS)
        pipes = self.core.GraphicsPipeSelection.getGlobalPtr()
        pipe = pipes.makePipe("TinyOffscreenGraphicsPipe", "p3tinydisplay")
        engine = self.core.GraphicsEngine(pipe)
        self.nowhere = self.core.NodePath()
        self.small = _Window(self.core, engine, pipe, (WIDTH_PX, HEIGHT_PX))
        size, state = (LARGE_WIDTH_PX, LARGE_HEIGHT_PX), self.small.state
        self.large = _Window(self.core, engine, pipe, size, state)


_engine = cache(_Engine)


class Renderer:
    """Renders one world from any pose, on any thread. The seed determines the floor's pattern."""

    def __init__(self, world: World, seed: int = 0) -> None:
        with _LOCK:
            self._engine = _engine()
            core = self._core = self._engine.core
            self._root = core.NodePath("world")
            self._n_shapes = 0
            lens = core.PerspectiveLens()
            lens.setFov(*FIELD_OF_VIEW_DEG)
            lens.setNearFar(0.01, 20.0)
            self._camera = self._root.attachNewNode(core.Camera("camera", lens))
            self._add_floor(world, np.random.default_rng(seed))
            self._add_shape(self._root, _walls(world))
            self._things = {one.name: self._add_thing(one) for one in world.obstacles}

    def render(self, pose: Pose, obstacles: Sequence[Obstacle] = ()) -> NDArray[np.uint8]:
        """Return the camera's view from `pose`, shape (120, 160, 3), RGB, rows from the top."""
        with _LOCK:
            for obstacle in obstacles:
                if obstacle.is_movable or obstacle.path:
                    node = self._things[obstacle.name]
                    node.setPos(obstacle.x_m, obstacle.y_m, 0.0)
                    node.setH(math.degrees(obstacle.heading_rad))
            # Panda3D's cameras look along the y axis, so subtract a quarter turn.
            self._camera.setPosHpr(
                pose.x_m + CAMERA_FORWARD_M * math.cos(pose.heading_rad),
                pose.y_m + CAMERA_FORWARD_M * math.sin(pose.heading_rad),
                CAMERA_HEIGHT_M,
                math.degrees(pose.heading_rad) - 90.0,
                CAMERA_PITCH_DEG,
                0.0,
            )
            return self._engine.small.draw(self._camera)

    def render_large(self) -> NDArray[np.uint8]:
        """Return the view of the last `render` at twice the resolution, for people.

        The shape is (240, 320, 3). The view is drawn in a separate window, so it does not affect
        the results of `render`.
        """
        with _LOCK:
            return self._engine.large.draw(self._camera)

    def close(self) -> None:
        """Free the world's textures and shapes; idempotent."""
        with _LOCK:
            for window in (self._engine.small, self._engine.large):
                window.forget(self._engine.nowhere)
            self._things.clear()
            self._camera.removeNode()
            self._root.removeNode()

    def _add_floor(self, world: World, rng: np.random.Generator) -> None:
        core = self._core
        pixels = _floor_pixels(world, rng)
        texture = core.Texture("floor")
        texture.setup2dTexture(_FLOOR_PX, _FLOOR_PX, core.Texture.TUnsignedByte, core.Texture.FRgb)
        texture.setRamImageAs(pixels.tobytes(), "RGB")
        texture.setKeepRamImage(False)  # both windows draw with the renderer's own copy
        width_m, depth_m = world.width_m, world.depth_m
        floor = ((0, 0, 0), (width_m, 0, 0), (width_m, depth_m, 0), (0, depth_m, 0))
        node = self._add_shape(self._root, [(floor, (255, 255, 255))])
        node.setTexture(texture)

    def _add_thing(self, obstacle: Obstacle) -> Any:
        """Add a thing: at its place if it is fixed, otherwise at the origin, to be moved later."""
        node = self._root.attachNewNode(obstacle.name)
        own = replace(obstacle, x_m=0.0, y_m=0.0, heading_rad=0.0)
        if not (obstacle.is_movable or obstacle.path):
            own = obstacle
        self._add_shape(node, _obstacle_sides(own))
        return node

    def _add_shape(self, parent: Any, quads: Iterable[_Quad]) -> Any:
        """Add quads as one shape, drawn in their order; a texture covers each quad.

        Drawing one shape for each quad would take a fifth longer.
        """
        core = self._core
        vertices = core.GeomVertexData(
            "shape", core.GeomVertexFormat.getV3c4t2(), core.Geom.UHStatic
        )
        position = core.GeomVertexWriter(vertices, "vertex")
        tint = core.GeomVertexWriter(vertices, "color")
        texture = core.GeomVertexWriter(vertices, "texcoord")
        triangles = core.GeomTriangles(core.Geom.UHStatic)
        for n, (corners, colour) in enumerate(quads):
            for corner, uv in zip(corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
                position.addData3(*corner)
                tint.addData4(*(part / 255 for part in colour), 1.0)
                texture.addData2(*uv)
            triangles.addVertices(4 * n, 4 * n + 1, 4 * n + 2)
            triangles.addVertices(4 * n, 4 * n + 2, 4 * n + 3)
        geometry = core.Geom(vertices)
        geometry.addPrimitive(triangles)
        node = core.GeomNode("shape")
        node.addGeom(geometry)
        path = parent.attachNewNode(node)
        path.setTwoSided(True)
        # Where two edges meet, the edge that is drawn last is visible, so the order must not vary.
        self._n_shapes += 1
        path.setBin("fixed", self._n_shapes)
        return path


def _walls(world: World) -> Iterator[_Quad]:
    """Yield the four walls, each with a different light, and with a dark skirting board."""
    width_m, depth_m, height_m = world.width_m, world.depth_m, world.wall_height_m
    corners = ((0.0, 0.0), (width_m, 0.0), (width_m, depth_m), (0.0, depth_m))
    for i, light in enumerate((0.94, 1.0, 0.88, 0.97)):
        (ax, ay), (bx, by) = corners[i], corners[(i + 1) % 4]
        for low_m, high_m, shade in ((0.0, 0.012, 0.6), (0.012, height_m, 1.0)):
            yield (
                ((ax, ay, low_m), (bx, by, low_m), (bx, by, high_m), (ax, ay, high_m)),
                _lit(world.wall_colours[i], light * shade),
            )


def _obstacle_sides(obstacle: Obstacle) -> Iterator[_Quad]:
    ring = _outline(obstacle)
    top = obstacle.height_m
    for i, (ax, ay) in enumerate(ring):
        bx, by = ring[(i + 1) % len(ring)]
        light = 0.85 + 0.25 * math.cos(math.atan2(by - ay, bx - ax) - 0.6)
        yield (
            ((ax, ay, 0.0), (bx, by, 0.0), (bx, by, top), (ax, ay, top)),
            _lit(obstacle.colour, light),
        )
        centre = (obstacle.x_m, obstacle.y_m, top)
        yield ((centre, (ax, ay, top), (bx, by, top), centre), _lit(obstacle.colour, 1.15))


def _outline(obstacle: Obstacle) -> list[tuple[float, float]]:
    half_width, half_depth = obstacle.width_m / 2, obstacle.depth_m / 2
    if obstacle.shape == "box":
        own = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    else:
        angles = [math.tau * i / _CYLINDER_SIDES for i in range(_CYLINDER_SIDES)]
        own = [(math.cos(angle), math.sin(angle)) for angle in angles]
    cos, sin = math.cos(obstacle.heading_rad), math.sin(obstacle.heading_rad)
    return [
        (
            obstacle.x_m + u * half_width * cos - v * half_depth * sin,
            obstacle.y_m + u * half_width * sin + v * half_depth * cos,
        )
        for u, v in own
    ]


def _floor_pixels(world: World, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the floor's texture: speckles for a carpet, squares for tiles."""
    colours = np.array(world.floor_colours, np.float64)
    if world.floor_pattern == "plain":
        picked = np.zeros((_FLOOR_PX, _FLOOR_PX), np.uint8)
    elif world.floor_pattern == "tiles":
        tile_m = 0.30
        across = (np.arange(_FLOOR_PX) / _FLOOR_PX * world.width_m / tile_m).astype(np.int64)
        along = (np.arange(_FLOOR_PX) / _FLOOR_PX * world.depth_m / tile_m).astype(np.int64)
        picked = ((across[None, :] + along[:, None]) % len(colours)).astype(np.uint8)
    else:
        coarse = rng.integers(0, len(colours), (_FLOOR_PX // 8, _FLOOR_PX // 8)).astype(np.uint8)
        picked = coarse.repeat(8, axis=0).repeat(8, axis=1)
    pixels = np.empty((_FLOOR_PX, _FLOOR_PX, 3), np.uint8)
    # A few rows at a time, because the process would never free the memory of larger arrays.
    for first in range(0, _FLOOR_PX, _FLOOR_ROWS):
        rows = slice(first, first + _FLOOR_ROWS)
        grain = rng.normal(0.0, 9.0, (_FLOOR_ROWS, _FLOOR_PX, 1))
        pixels[rows] = (colours[picked[rows]] + grain).clip(0, 255)
    return pixels


def _lit(colour: Colour, light: float) -> Colour:
    red, green, blue = (min(255, round(part * light)) for part in colour)
    return red, green, blue
