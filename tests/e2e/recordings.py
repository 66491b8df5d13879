"""Makes a recording without driving, for tests of pages that show and edit it."""

from __future__ import annotations

import functools
import time

from robot.devkit.pictures import Picture
from robot.exchange.drive import Drive, FrameEvent, write_episode
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world
from robot.types import Action, Encoding, Mode, PilotCommand
from server.recordings.part import Recordings

from .world import World

FORWARD, LEFT = Action.FORWARD, Action.LEFT
FILMED = 70


@functools.cache
def film_a_good_pilot(frames: int) -> tuple[FrameEvent, ...]:
    """Render ten pictures a second of a simulated robot whose pilot turns left before a wall."""
    simulation = Simulation(load_world("box"), seed=5)
    held, shots = FORWARD, []
    for i in range(frames):
        near = simulation.sensors.read().distance_m or 0.0
        held = LEFT if near < (0.4 if held is FORWARD else 0.7) else FORWARD
        pixels = simulation.render()
        picture = functools.partial(
            Picture, data=pixels.tobytes(), encoding=Encoding.RGB, width=160, height=120
        )
        shots.append(FrameEvent(t_s=i / 10, picture=picture, label=held))
        simulation.action = held
        simulation.step(0.1)
    simulation.close()
    return tuple(shots)


def put_recording(world: World) -> None:
    """Make a recording without driving, so that a busy machine does not make it shorter."""
    store = world.persistence.part(Recordings).episodes
    film = Drive(
        name="film",
        source="simulation",
        shots=list(film_a_good_pilot(FILMED)),
        moves=(FORWARD, LEFT),
    )
    write_episode(film, store.new_path("2026-01-01_120000_000"))


def drive(world: World, examples: int) -> None:
    """Drive without a page until the robot has enough examples; begin again after each stop by a
    busy machine."""
    loop, clock = world.rig.loop, world.rig.clock
    latest_s = clock.now_s() + 60.0
    while world.lessons < examples:
        now_s = clock.now_s()
        assert now_s < latest_s, f"only {world.lessons} examples were taught"
        if world.mode is not Mode.TRAIN:
            loop.set_mode(Mode.TRAIN).result(60)
        held = LEFT if int(now_s * 2) % 2 else FORWARD
        frame_id = loop.state.frame_id
        loop.command(
            PilotCommand(held=held, frame_id=frame_id, seq=int(now_s * 1e3), received_s=now_s)
        )
        time.sleep(0.05)
    loop.set_mode(Mode.STOPPED).result(60)
