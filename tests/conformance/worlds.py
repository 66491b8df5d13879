"""Environments of other packages, each driven by the newest release: `--worlds`.

Each package gets a separate Python environment, in which `in_world.py` drives some of its
environments. The resulting table is written into the how-to.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .in_world import LONGEST

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "howto" / "gymnasium.md"
PATIENCE_S = 600
_MARK = re.compile(r"(<!-- worlds: .*? -->\n).*?(<!-- /worlds -->)", re.S)


@dataclass(frozen=True, slots=True)
class Package:
    """A package that the index has, and some of its environments.

    Args:
        install: What is installed, the package first.
        envs: As `--env` names them; one may be followed by `--env-options` after a blank.
        python: The newest Python that it is for; empty: the newest there is.
        steps: `--env-steps`.
    """

    install: str
    envs: list[str]
    python: str = ""
    steps: int = 0

    @property
    def name(self) -> str:
        return re.split(r"[\[ ]", self.install)[0]


def _of(module: str, names: str) -> list[str]:
    return [f"{module}:{name}" for name in names.split()]


_GYMNASIUM = """
CarRacing-v3 LunarLander-v3 BipedalWalker-v3 CartPole-v1 MountainCar-v0 MountainCarContinuous-v0
Pendulum-v1 Acrobot-v1 FrozenLake-v1 CliffWalking-v1 Blackjack-v1 InvertedPendulum-v5 Reacher-v5
Swimmer-v5
"""
_MINIWORLD = "MiniWorld-Sidewalk-v0 MiniWorld-Hallway-v0 MiniWorld-OneRoom-v0"
_MINIGRID = "MiniGrid-Empty-8x8-v0 MiniGrid-DoorKey-6x6-v0 BabyAI-GoToRedBall-v0"
_VIZDOOM = "VizdoomHealthGathering-v1 VizdoomBasic-v1 VizdoomDefendLine-v1"
_HIGHWAY = "highway-v0 racetrack-v0 parking-v0 merge-v0"
_BULLET = "InvertedPendulumBulletEnv-v0 HopperBulletEnv-v0"
_QUADX = _of("PyFlyt.gym_envs", "PyFlyt/QuadX-Hover-v4")
PACKAGES = (
    Package("gymnasium[box2d,classic-control,mujoco,toy-text]", _GYMNASIUM.split()),
    Package("miniworld", _of("miniworld", _MINIWORLD)),
    Package("minigrid", _of("minigrid", _MINIGRID)),
    Package("vizdoom", _of("vizdoom.gymnasium_wrapper", _VIZDOOM), steps=4),
    Package("highway-env", _of("highway_env", _HIGHWAY)),
    Package("ale-py", _of("ale_py", "ALE/Breakout-v5 ALE/Pong-v5 ALE/Freeway-v5")),
    Package("stable-retro", ["stable_retro:make game=Airstriker-Genesis-v0"], steps=4),
    Package("gym-super-mario-bros", ["gym_super_mario_bros:SuperMarioBros-1-1-v0"], steps=4),
    Package("pybullet-envs-gymnasium", _of("pybullet_envs_gymnasium", _BULLET), "3.11"),
    Package("panda-gym", _of("panda_gym", "PandaReach-v3 PandaPush-v3"), "3.11"),
    Package("gymnasium-robotics", _of("gymnasium_robotics", "FetchReach-v4 PointMaze_UMaze-v3")),
    Package("gym-pusht", ["gym_pusht:gym_pusht/PushT-v0"]),
    Package("gym-aloha", ["gym_aloha:gym_aloha/AlohaInsertion-v0"]),
    Package("flappy-bird-gymnasium", ["flappy_bird_gymnasium:FlappyBird-v0"]),
    Package("mo-gymnasium", _of("mo_gymnasium", "minecart-v0 deep-sea-treasure-v0")),
    Package("gymnasium-2048", ["gymnasium_2048:gymnasium_2048/TwentyFortyEight-v0"]),
    Package("gymnasium-cartpole-swingup", ["gymnasium_cartpole_swingup:CartPoleSwingUp-v0"]),
    Package("miniworld-maze", ["miniworld_maze:FourRooms-v0"]),
    Package("pgtg", ["pgtg:pgtg-exploration_2x2-v0"]),
    Package("mazegym", ["mazegym:Maze21x21Random-v0"]),
    Package("crafter", ["crafter:Env"]),
    Package("pyflyt", _QUADX, "3.11"),
    Package("shimmy[dm-control]", ["shimmy:dm_control/cartpole-balance-v0"]),
)
"""The packages that are tried."""


def drive_all(folder: Path, only: list[str]) -> Iterator[dict[str, Any]]:
    """Install each package and drive its environments; yield what came of each.

    A package that cannot be installed yields one result with `absent`.
    """
    for package in PACKAGES:
        if only and package.name not in only:
            continue
        home = folder / package.name
        home.mkdir(parents=True, exist_ok=True)
        try:
            python, version = _installed(home, package)
        except subprocess.CalledProcessError as error:
            why = (error.stderr or error.stdout).strip().splitlines() or ["no reason given"]
            yield {"package": package.name, "absent": why[-1][:200]}
            continue
        for env in package.envs:
            told = _drive(python, env, package.steps, home)
            yield {"package": package.name, "version": version, **told}


def describe(result: dict[str, Any]) -> str:
    """Return a result as a line for a person."""
    about = f"{result['package']} {result.get('version', '')} {result.get('env', '')}"
    if "absent" in result:
        return f"{about}: not to be had: {result['absent']}"
    if "refused" in result:
        return f"{about}: refused: {result['refused']}"
    seen = {True: "as given", False: "DIFFERENT", None: "look"}[result["equals"]]
    facts = (
        f"{result['picture']} ({seen}), {len(result['moves'])} moves ({' '.join(result['moves'])}),"
        f" {result['games']} games, taught {result['taught']}, drove {result['driven']},"
        f" {result['step_ms']} ms a step"
    )
    return f"{about}: {facts}" + "".join(f"; WRONG: {one}" for one in result["wrong"])


def is_right(result: dict[str, Any]) -> bool:
    return "wrong" in result and not result["wrong"]


def write_table(results: list[dict[str, Any]]) -> None:
    """Write the table of the how-to: one line per package with the environments driven without a
    fault."""
    lines = [
        "| package | install | drive | pictures and moves | also driven |",
        "|---|---|---|---|---|",
    ]
    for package in PACKAGES:
        right = [one for one in results if one["package"] == package.name and is_right(one)]
        if not right:
            continue
        first, others = right[0], right[1:]
        name, _, options = first["env"].partition(" ")
        extra = f" --env-options {options}" if options else ""
        extra += f" --env-steps {package.steps}" if package.steps else ""
        moves = ", ".join(first["moves"][:6]) + (", ..." if len(first["moves"]) > 6 else "")
        also = ", ".join(f"`{one['env'].split(':')[-1]}`" for one in others)
        lines.append(
            f"| {package.name} {first['version']} | `pip install '{package.install}'` | "
            f"`--env {name}{extra}` | {first['picture']}; {moves} | {also} |"
        )
    table = "\n".join(lines)
    PAGE.write_text(_MARK.sub(lambda m: f"{m[1]}{table}\n{m[2]}", PAGE.read_text("utf-8")), "utf-8")


def _installed(home: Path, package: Package) -> tuple[Path, str]:
    """Return a Python with this package and our requirements, and the package's version."""
    python = home / "env" / "bin" / "python"
    if not python.exists():
        _run([_python(package.python), "-m", "venv", str(home / "env")])
    wanted = [f"{ROOT}[gymnasium]", *package.install.split()]
    _run([str(python), "-m", "pip", "install", "--quiet", "--upgrade", *wanted])
    say = f"import importlib.metadata as m; print(m.version({package.name!r}))"
    return python, _run([str(python), "-c", say]).strip()


def _python(newest: str) -> str:
    """Return the newest Python of this machine, or the running one."""
    from .__main__ import pythons

    found = [str(python) for python in pythons()]
    return next((one for one in found if one.endswith(newest)), found[0])


def _drive(python: Path, env: str, steps: int, home: Path) -> dict[str, Any]:
    name, _, options = env.partition(" ")
    is_registered = re.search(r"-v\d+$", name) is not None
    given = f"max_episode_steps={LONGEST}" if is_registered else options
    words = [str(python), "-m", "tests.conformance.in_world", name, given, str(steps), str(home)]
    environ = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    how: dict[str, Any] = {"cwd": ROOT, "env": environ, "capture_output": True, "text": True}
    try:
        done = subprocess.run(words, **how, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        return {"env": env, "refused": f"not done within {PATIENCE_S} s"}
    line = next((one for one in done.stdout.splitlines() if one.startswith("WORLD ")), None)
    if line is None:
        why = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        return {"env": env, "refused": f"TRACEBACK: {why[:300]}"}
    return {**json.loads(line.removeprefix("WORLD ")), "env": env}


def _run(words: list[str]) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=3600).stdout
