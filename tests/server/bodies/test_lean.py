"""A lean server never loads omitted modules, and loads postponed modules when they are used."""

import sys

from server.bodies.lean import LEFT_OUT, PUT_OFF
from tests.kit.run import run

PROGRAM = """
import sys
from server.bodies.lean import PUT_OFF, leave_out_unused
if sys.argv[1:]:
    leave_out_unused()
import hashlib, numpy, shutil, uvicorn, zipfile
print(*(name for name, module in sys.modules.items() if module and name in PUT_OFF
        and type(module).__name__ != "_LazyModule"), "|",
      *(name for name in sys.modules if name in {left_out!r} and sys.modules[name]), "|",
      numpy.random.default_rng(7).integers(10), numpy.median([1.0, 3.0]),
      len(numpy.fft.rfft([1.0, 2.0])), hashlib.sha256(b"").hexdigest()[:6])
"""


def said_with(*lean: str) -> list[str]:
    program = PROGRAM.replace("{left_out!r}", repr(LEFT_OUT))
    done = run(sys.executable, "-c", program, *lean)
    assert done.returncode == 0, done.stderr
    return [part.strip() for part in done.stdout.split("|")]


def test_a_postponed_module_is_loaded_when_it_is_used():
    lean, full = said_with("lean"), said_with()
    assert lean[:2] == ["", ""]
    assert lean[2] == full[2]
    assert "logging.config" in full[0], "the check does see loaded modules"
    assert set(full[0].split()) <= set(PUT_OFF)
