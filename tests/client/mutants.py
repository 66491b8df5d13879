"""Put deliberate faults into a copy of the program, and see whether the random client finds them.

`python -m tests.client.mutants`: prints for each fault after how many steps which violation was
found. Fails if one was not found. `--only WORD` chooses; `--steps` limits each.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
COPIED = ("pyproject.toml", "robot", "server", "tests", "web", "docs")


@dataclass(frozen=True)
class Mutant:
    """A fault: in each file, the first text becomes the second."""

    name: str
    edits: tuple[tuple[str, str, str], ...]


def _one(name: str, file: str, before: str, after: str) -> Mutant:
    return Mutant(name, ((file, before, after),))


MUTANTS = (
    _one(
        "a late release undoes a newer STOP",
        "server/clients/hub.py",
        "if stop_number != self.stop_number:",
        "if False:",
    ),
    _one(
        "the board releases a STOP that the teacher has not seen",
        "server/board/stopping.py",
        "if stop != self.id:",
        "if False:",
    ),
    _one(
        "a STOP does not latch",
        "robot/control/gate.py",
        "        self.emergency = True\n",
        "        self.emergency = False\n",
    ),
    _one(
        "the eye's STOP is ignored",
        "server/bodies/eye_routes.py",
        'self._hub.latch_emergency("eye", EYE)',
        "pass",
    ),
    _one(
        "the board sends its STOP nowhere",
        "server/board/stopping.py",
        "await channel.send(words)",
        "pass",
    ),
    Mutant(
        "a vanished pilot's wheels turn on for a second",
        (
            (
                "robot/control/gate.py",
                "supervised_s = self._proven_s + self.config.supervision_timeout_s",
                "supervised_s = self._proven_s + 1.5",
            ),
            (
                "robot/control/gate.py",
                "return min(supervised_s, self._heard_s + self.config.pilot_timeout_s)",
                "return supervised_s",
            ),
            ("robot/control/loop.py", "if link.must_stop:", "if False:"),
        ),
    ),
    _one(
        "whoever is connected drives",
        "server/clients/hub.py",
        "if self.lease.owner != client.id:\n            raise",
        "if False:\n            raise",
    ),
    _one(
        "a false reason is given for a stop",
        "robot/control/loop.py",
        "self._gate.trip(StopReason.LINK_SLOW)",
        "self._gate.trip(StopReason.CAMERA_FAULT)",
    ),
    _one(
        "files are written in place",
        "robot/store/folder.py",
        '    temporary = path.with_name(f".{path.name}.{get_native_id()}.part")',
        "    temporary = path",
    ),
    _one(
        "a change that could not be written is answered as saved",
        "server/services.py",
        "return made, await self.persistence.journal.written(number)",
        "await self.persistence.journal.written(number)\n        return made, True",
    ),
    _one(
        "a new name is answered and not written",
        "server/identity.py",
        "        self._write(changed)\n",
        "",
    ),
    _one(
        "an unpaired browser is admitted again after the next start",
        "server/access/pairing.py",
        "return self._save() if known is not None else self._is_saved or self._save()",
        "return True",
    ),
    _one(
        "`episodes title` and `protect` say that they did it",
        "robot/recordings/store.py",
        "            write_notes(path, notes)\n            return notes",
        "            return notes",
    ),
    _one(
        "at a new address nobody is admitted",
        "server/access/surroundings.py",
        "self._change(dataclasses.replace(before, addresses=addresses, machine=machine))",
        "self._change(dataclasses.replace(before, machine=machine))",
    ),
    _one(
        "an unknown episode is an error of the server",
        "robot/recordings/store.py",
        "raise NotFoundError(",
        "raise KeyError(",
    ),
)


def try_out(mutant: Mutant, folder: Path, steps: int, seed: int) -> str | None:
    """Return what the random client found in a copy with this fault; None if it found nothing."""
    for name in COPIED:
        source, target = ROOT / name, folder / name
        if source.is_file():
            shutil.copy2(source, target)
        else:
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("node_modules"))
    for file, before, after in mutant.edits:
        text = (folder / file).read_text("utf-8")
        assert before in text, f"{file} has no {before!r} any more"
        (folder / file).write_text(text.replace(before, after, 1), "utf-8")
    words = ["-m", "tests.client", "--first", "--steps", str(steps), "--seed", str(seed)]
    ran = subprocess.run(
        [sys.executable, *words, "--kills", str(max(1, steps // 100))],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line for line in ran.stdout.splitlines() if line.startswith(("VIOLATION", "life "))]
    if ran.returncode and not lines:
        raise RuntimeError(ran.stdout + ran.stderr)
    after_steps = ran.stdout.splitlines()[-1].split(" in ")[0]
    return f"after {after_steps}: {lines[0]}" if lines else None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    missed = 0
    for mutant in MUTANTS:
        if args.only not in mutant.name:
            continue
        with tempfile.TemporaryDirectory() as name:
            found = try_out(mutant, Path(name), args.steps, args.seed)
        missed += found is None
        print(f"{mutant.name}: {found or 'NOT FOUND'}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
