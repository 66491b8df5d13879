"""What the simulated camera sees: Panda3D's software renderer, without display or GPU.

A renderer must be used only on the thread that made it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.devices.simulation.world import Colour, Obstacle, World
from robot.errors import need
from robot.types import Pose

WIDTH_PX, HEIGHT_PX = 160, 120
LARGE_WIDTH_PX, LARGE_HEIGHT_PX = 320, 240
CAMERA_HEIGHT_M = 0.14
CAMERA_FORWARD_M = 0.05
CAMERA_PITCH_DEG = -18.0
FIELD_OF_VIEW_DEG = (62.0, 48.5)

_Point = tuple[float, float, float]
_Quad = tuple[tuple[_Point, _Point, _Point, _Point], Colour]
_FLOOR_PX = 512
_CYLINDER_SIDES = 16


class Renderer:
    """Renders one world from any pose; the seed decides the floor's pattern."""

    def __init__(self, world: World, seed: int = 0) -> None:
        core = need("panda3d.core", "the simulator", "sim")
        core.loadPrcFileData("", "notify-level error\naudio-library-name null\n")
        self._core = core
        pipes = core.GraphicsPipeSelection.getGlobalPtr()
        self._pipe = pipes.makePipe("TinyOffscreenGraphicsPipe", "p3tinydisplay")
        self._engine = core.GraphicsEngine(self._pipe)
        self._root = core.NodePath("world")
        self._n_quads = 0
        lens = core.PerspectiveLens()
        lens.setFov(*FIELD_OF_VIEW_DEG)
        lens.setNearFar(0.01, 20.0)
        self._camera = self._root.attachNewNode(core.Camera("camera", lens))
        self._window, self._texture = self._open_window("camera", WIDTH_PX, HEIGHT_PX)
        self._large: tuple[Any, Any] | None = None
        self._add_floor(world, np.random.default_rng(seed))
        for corners, colour in _walls(world):
            self._add_quad(corners, colour)
        self._things = {obstacle.name: self._add_thing(obstacle) for obstacle in world.obstacles}
        self._engine.renderFrame()  # the first frame of a new window is empty

    def render(self, pose: Pose, obstacles: Sequence[Obstacle] = ()) -> NDArray[np.uint8]:
        """Return what the camera sees from `pose`, shape (120, 160, 3), RGB, rows from the top."""
        for obstacle in obstacles:
            if obstacle.is_movable or obstacle.path:
                node = self._things[obstacle.name]
                node.setPos(obstacle.x_m, obstacle.y_m, 0.0)
                node.setH(math.degrees(obstacle.heading_rad))
        self._camera.setPos(
            pose.x_m + CAMERA_FORWARD_M * math.cos(pose.heading_rad),
            pose.y_m + CAMERA_FORWARD_M * math.sin(pose.heading_rad),
            CAMERA_HEIGHT_M,
        )
        # Panda3D's cameras look along y, so straight ahead is a quarter turn less.
        self._camera.setHpr(math.degrees(pose.heading_rad) - 90.0, CAMERA_PITCH_DEG, 0.0)
        self._engine.renderFrame()
        return _pixels(self._texture, WIDTH_PX, HEIGHT_PX)

    def render_large(self) -> NDArray[np.uint8]:
        """Return what the last `render` showed at twice its size, shape (240, 320, 3), for the eye.

        It has a window of its own, which sleeps while the other draws and the other way round:
        what `render` returns does not depend on it.
        """
        is_new = self._large is None
        if self._large is None:
            self._large = self._open_window("large", LARGE_WIDTH_PX, LARGE_HEIGHT_PX)
        window, texture = self._large
        self._window.setActive(False)
        window.setActive(True)
        for _ in range(1 + is_new):  # the first frame of a new window is empty
            self._engine.renderFrame()
        window.setActive(False)
        self._window.setActive(True)
        return _pixels(texture, LARGE_WIDTH_PX, LARGE_HEIGHT_PX)

    def close(self) -> None:
        self._engine.removeAllWindows()

    def _open_window(self, name: str, width_px: int, height_px: int) -> tuple[Any, Any]:
        """Return a new window that the camera looks through, and the texture that it fills."""
        core = self._core
        properties = core.FrameBufferProperties()
        properties.setRgbColor(True)
        properties.setDepthBits(16)
        size = core.WindowProperties.size(width_px, height_px)
        refuse = core.GraphicsPipe.BFRefuseWindow
        window = self._engine.makeOutput(self._pipe, name, 0, properties, size, refuse)
        texture = core.Texture()
        window.addRenderTexture(texture, core.GraphicsOutput.RTMCopyRam)
        window.makeDisplayRegion().setCamera(self._camera)
        return window, texture

    def _add_floor(self, world: World, rng: np.random.Generator) -> None:
        core = self._core
        pixels = _floor_pixels(world, rng)
        texture = core.Texture("floor")
        texture.setup2dTexture(_FLOOR_PX, _FLOOR_PX, core.Texture.TUnsignedByte, core.Texture.FRgb)
        texture.setRamImageAs(pixels.tobytes(), "RGB")
        width_m, depth_m = world.width_m, world.depth_m
        floor = ((0, 0, 0), (width_m, 0, 0), (width_m, depth_m, 0), (0, depth_m, 0))
        node = self._add_quad(floor, (255, 255, 255), texture_corners=True)
        node.setTexture(texture)

    def _add_thing(self, obstacle: Obstacle) -> Any:
        """Add a thing round its own centre; a fixed thing is placed once and for all."""
        node = self._root.attachNewNode(obstacle.name)
        own = replace(obstacle, x_m=0.0, y_m=0.0, heading_rad=0.0)
        if not (obstacle.is_movable or obstacle.path):
            own = obstacle
        for corners, colour in _obstacle_sides(own):
            self._add_quad(corners, colour, parent=node)
        return node

    def _add_quad(
        self,
        corners: tuple[Any, ...],
        colour: Colour,
        *,
        texture_corners: bool = False,
        parent: Any = None,
    ) -> Any:
        core = self._core
        vertices = core.GeomVertexData(
            "quad", core.GeomVertexFormat.getV3c4t2(), core.Geom.UHStatic
        )
        position = core.GeomVertexWriter(vertices, "vertex")
        tint = core.GeomVertexWriter(vertices, "color")
        texture = core.GeomVertexWriter(vertices, "texcoord")
        for corner, uv in zip(corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
            position.addData3(*corner)
            tint.addData4(*(part / 255 for part in colour), 1.0)
            texture.addData2(*(uv if texture_corners else (0, 0)))
        triangles = core.GeomTriangles(core.Geom.UHStatic)
        triangles.addVertices(0, 1, 2)
        triangles.addVertices(0, 2, 3)
        geometry = core.Geom(vertices)
        geometry.addPrimitive(triangles)
        node = core.GeomNode("quad")
        node.addGeom(geometry)
        path = (parent or self._root).attachNewNode(node)
        path.setTwoSided(True)
        # Where two edges meet, whoever is drawn last wins: keep to one order, run after run.
        self._n_quads += 1
        path.setBin("fixed", self._n_quads)
        return path


def _pixels(texture: Any, width_px: int, height_px: int) -> NDArray[np.uint8]:
    """Return what a window drew, rows from the top."""
    data = texture.getRamImageAs("RGB")
    return np.frombuffer(data, np.uint8).reshape(height_px, width_px, 3)[::-1].copy()


def _walls(world: World) -> Iterator[_Quad]:
    """The four walls, each lit a little differently, with a dark skirting at the foot."""
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
    """The floor as a texture: speckles for a carpet, squares for tiles."""
    colours = np.array(world.floor_colours, np.float64)
    if world.floor_pattern == "plain":
        picked = np.zeros((_FLOOR_PX, _FLOOR_PX), np.int64)
    elif world.floor_pattern == "tiles":
        tile_m = 0.30
        across = (np.arange(_FLOOR_PX) / _FLOOR_PX * world.width_m / tile_m).astype(np.int64)
        along = (np.arange(_FLOOR_PX) / _FLOOR_PX * world.depth_m / tile_m).astype(np.int64)
        picked = (across[None, :] + along[:, None]) % len(colours)
    else:
        coarse = rng.integers(0, len(colours), (_FLOOR_PX // 8, _FLOOR_PX // 8))
        picked = coarse.repeat(8, axis=0).repeat(8, axis=1)
    grain = rng.normal(0.0, 9.0, (_FLOOR_PX, _FLOOR_PX, 1))
    pixels: NDArray[np.uint8] = (colours[picked] + grain).clip(0, 255).astype(np.uint8)
    return pixels


def _lit(colour: Colour, light: float) -> Colour:
    red, green, blue = (min(255, round(part * light)) for part in colour)
    return red, green, blue
