import gc
import os
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import hypothesis
import pytest

# If each of two workers has a thread for each core, they slow each other down: kNN takes ten times
# as long. scikit-learn reads the variable when it is loaded; numpy is loaded already, so the
# Makefile sets the variable, too.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from tests import wall_clock
from tests.kit.sizes import examples
from tests.wall_clock import _off_the_wall_clock  # noqa: F401

# If a test names no timeout, httpx uses 5 s, which a busy machine may exceed.
for part in ("connect", "read", "write", "pool"):
    setattr(httpx._config.DEFAULT_TIMEOUT_CONFIG, part, 60.0)

# An example has no time limit, because a busy machine is not a fault. The examples are the same in
# every run; `--hypothesis-profile=searching` tries other ones.
for name, is_same in (("unhurried", True), ("searching", False)):
    hypothesis.settings.register_profile(
        name,
        deadline=None,
        max_examples=examples(100),
        derandomize=is_same,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
hypothesis.settings.load_profile("unhurried")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--ev3",
        metavar="ADDRESS",
        help="run the contract of drivers and cameras on a real brick, whose agent runs; "
        "let its wheels turn freely",
    )


def pytest_configure(config: pytest.Config) -> None:
    if address := config.getoption("--ev3"):
        os.environ["DRIVELESSON_EV3"] = address


def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """Mark tests of real parts, limit the number of other real-time tests, and sort all tests."""
    wall_clock.hold_to_the_limit(session, items)
    here = Path(__file__).parent
    for item in items:
        if wall_clock.is_exempt(item.path.relative_to(here).as_posix(), item.name):
            item.add_marker(pytest.mark.realtime)
    # The longest files come first, so that all workers end at about the same time.
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_sessionstart() -> None:
    """Turn off garbage collection while pytest collects tests, because the collected objects exist
    until the end."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection, because they exist until the end."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_data_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Give each test a data folder, so that no test uses the folder of the person who runs it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DRIVELESSON_DATA", str(tmp_path_factory.mktemp("data")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _own_folder_for_inner_runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """If a test starts pytest itself, give this pytest a separate temporary folder.

    Each pytest removes old temporary folders when it ends. Two pytests that clean one folder at the
    same time warn of an unclosed `scandir`, and a warning is an error here (pytest 9).
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTEST_DEBUG_TEMPROOT", str(tmp_path_factory.mktemp("inner")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _authorities_are_read_once() -> Iterator[None]:
    """Cache the TLS context, because otherwise each `httpx.get` spends 30 ms, most of a virtual
    request, on reading all authorities."""
    before, trust = httpx.HTTPTransport.__init__, ssl.create_default_context()

    def begin(transport: httpx.HTTPTransport, verify: Any = True, **options: Any) -> None:
        before(transport, verify=trust if verify is True else verify, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(httpx.HTTPTransport, "__init__", begin)
        yield


@pytest.fixture(scope="session")
def npm_modules() -> Path:
    """Return the folder of the npm packages that the page's tests need; CI installs it."""
    folder = Path(__file__).parent / "web"
    modules = folder / "node_modules"
    if os.environ.get("CI") == "true" and not modules.is_dir():
        subprocess.run(
            ["npm", "ci", "--no-audit", "--no-fund"], cwd=folder, check=True, timeout=300
        )
    if not modules.is_dir():
        pytest.skip("TYPES AND AXE WERE NOT CHECKED: run npm ci in tests/web (CI does)")
    return modules
