"""`drivelesson class` as it is delivered, run in a new folder; in CI a wheel in a new environment.

A teacher starts it, from codes on paper to Ctrl-C; what is kept for the next day is tested in
tests/server. In CI ten pupils teach at once and hand over at once, and one STOP holds all.
"""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.board.class_key import read_class_key
from server.board.class_orders import give_order
from tests.kit.sizes import IS_FULL, only_full, size
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot

from .hand import Fingers, pad
from .world import PHONE

pytestmark = [pytest.mark.browser, pytest.mark.slow]
ROOT = Path(__file__).parents[2]
ROBOTS, PUPILS, TRIES = size("ROBOTS", 2, 3), size("ROBOTS", 2, 10), 300
PORTS_APART = 16
CLAIMS: list[socket.socket] = []
READ_CODES = """async () => {
  const images = [...document.querySelectorAll('article .code')];
  await Promise.all(images.map((image) => image.decode()));
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 312;
  return images.map((image) => {
    canvas.getContext('2d').drawImage(image, 0, 0, 312, 312);
    return canvas.toDataURL('image/png').split(',')[1];
  });
}"""


def free_ports(count: int) -> int:
    """Return the first of this number of free ports in a row, at most fifteen.

    The port before them stays bound while this process lives, so that no other worker, and no other
    run of these tests on this machine, gets the same ports.
    """
    for before in range(21_000, 32_000, PORTS_APART):
        claim = socket.socket()
        with contextlib.ExitStack() as held, contextlib.suppress(OSError):
            claim.bind(("127.0.0.1", before))
            for port in range(before + 1, before + 1 + count):
                held.enter_context(socket.socket()).bind(("127.0.0.1", port))
            CLAIMS.append(claim)
            return before + 1
        claim.close()
    raise AssertionError("no free ports")


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the command: in CI that of the wheel, in an environment of its own.

    What the wheel asks for is that of these tests: only the program itself is new.
    """
    if not IS_FULL:
        return Path(sys.executable).with_name("drivelesson")
    place = tmp_path_factory.mktemp("delivered")
    building = ["-m", "hatchling", "build", "--target", "wheel", "--directory", str(place)]
    subprocess.run([sys.executable, *building], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = place.glob("*.whl")
    venv.create(place / "venv")
    python = place / "venv/bin/python"
    installing = ["--python", str(python), "install", "--quiet", "--no-deps", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", *installing], check=True)
    library = next((place / "venv/lib").glob("python*/site-packages"))
    (library / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    asked = [python, "-c", "import robot, server; print(robot.__file__, server.__file__)"]
    said = subprocess.run(asked, cwd=place, capture_output=True, text=True, check=True)
    assert said.stdout.count(str(library)) == 2, "the program is that of the wheel"
    return place / "venv/bin/drivelesson"


@contextlib.contextmanager
def a_class(
    folder: Path, port: int, robots: int, command: Path
) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run the command inside the block; yield the board's address."""
    words = ["class", "--robots", str(robots), "--host", "127.0.0.1", "--port", str(port)]
    process = subprocess.Popen(
        [str(command), *words, "--data", str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
    )
    assert process.stdout is not None
    with process, contextlib.ExitStack() as ending:
        ending.callback(process.send_signal, signal.SIGINT)
        address = process.stdout.readline().split("open ")[1].strip()
        wait_until(lambda: statuses(address) == ["there"] * robots, "all robots are there", 120)
        yield address, process


def statuses(board: str) -> list[str]:
    return [robot["status"] for robot in robots_of(board)]


def robots_of(board: str) -> list[dict[str, Any]]:
    robots: list[dict[str, Any]] = httpx.get(f"{board}/api/robots").json()["robots"]
    return robots


def read_paper(page: Any) -> list[str]:
    """Return the codes that a phone reads off the printed page.

    They are found by markers, because OpenCV's other reader misses one in 250 valid codes.
    """
    cv2, numpy = pytest.importorskip("cv2"), pytest.importorskip("numpy")
    import base64

    page.locator("article img.code").nth(ROBOTS - 1).wait_for()
    found = []
    for text in page.evaluate(READ_CODES):
        data = numpy.frombuffer(base64.b64decode(text), dtype=numpy.uint8)
        found.append(cv2.QRCodeDetectorAruco().detectAndDecode(cv2.imdecode(data, 1))[0])
    return found


def press(page: Any, mode: str, until: Callable[[], bool]) -> None:
    """Choose a mode like a patient person, until it has an effect."""
    button = page.locator(f"mode-bar [data-mode={mode}]")
    for _ in range(TRIES):
        if until():
            return
        if button.get_attribute("aria-checked") != "true" and button.is_enabled():
            button.click()
        page.wait_for_timeout(200)
    raise AssertionError(f"nothing came of {mode}")


def running(folder: Path) -> list[str]:
    """Return the processes that belong to this folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = entry.read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")
            if str(folder) in words and "pytest" not in words:
                found.append(words)
    return found


@pytest.mark.timeout(900)
def test_a_class_works_from_the_printed_codes_to_ctrl_c(
    chromium: Any, delivered: Path, tmp_path: Path
) -> None:
    port = free_ports(ROBOTS + 1)
    context = chromium.new_context(locale="en")
    phones = []
    with a_class(tmp_path, port, ROBOTS, delivered) as (board, _):
        shown = robots_of(board)
        for field in ("name", "colour", "address"):
            assert len({robot[field] for robot in shown}) == ROBOTS, "each can be told apart"

        paper = context.new_page()
        paper.goto(f"{board}/codes")
        codes = read_paper(paper)
        assert [code.split("/pair#")[0] for code in codes] == [one["address"] for one in shown]
        for card, code in zip(paper.locator("article").all_inner_texts(), codes, strict=True):
            assert code.split("#")[1] in card.replace("-", ""), "a phone that cannot scan needs it"

        # All pupils scan, teach, and hand over at the same time.
        for code in codes:
            phone = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
            pupil = phone.new_page()
            pupil.goto(code)
            pupil.wait_for_selector("video-view[data-frames]", state="attached")
            phones.append(pupil)
        for i, pupil in enumerate(phones):

            def has_taught(i: int = i) -> bool:
                return int(robots_of(board)[i]["lessons"] or 0) >= 5

            press(pupil, "train", lambda i=i: robots_of(board)[i]["mode"] == "train")
            fingers = Fingers(pupil)
            fingers.press(pad("forward"))
            with contextlib.suppress(AssertionError):  # stopped by a busy machine: taught later
                wait_until(has_taught, "its pupil teaches it", 20)
            fingers.lift()
            press(pupil, "autonomous", lambda i=i: robots_of(board)[i]["mode"] == "autonomous")
        assert any(robot["lessons"] for robot in robots_of(board))

        # One STOP for all.
        httpx.post(f"{board}/api/stop", json={})
        wait_until(lambda: all(one["emergency"] for one in robots_of(board)), "all are stopped")
        for order, did in {"hand-over": "is ready for the next class", "undo": "as it was"}.items():
            is_done, lines = give_order(order, port)
            assert is_done and "".join(lines).count(did) == ROBOTS, lines
    assert running(tmp_path) == [], "Ctrl-C leaves no process"

    for pupil in phones:
        pupil.context.close()
    context.close()


def teach(pupil: Pilot) -> None:
    for move, wanted in (("forward", 10), ("left", 20)):
        pupil.drive_until(lambda wanted=wanted: pupil.state["lessons"] >= wanted, move)
    pupil.hold(None)


def hand_over(pupil: Pilot) -> None:
    pupil.drive_until(lambda: pupil.state["mode"] == "autonomous", None, "autonomous")


@only_full
@pytest.mark.timeout(600)
def test_ten_pupils_of_a_class_teach_and_stand_at_once(delivered: Path, tmp_path: Path) -> None:
    port = free_ports(PUPILS + 1)
    with (
        a_class(tmp_path, port, PUPILS, delivered) as (board, process),
        contextlib.ExitStack() as leaving,
        ThreadPoolExecutor(PUPILS) as pool,
    ):
        code = read_class_key(tmp_path / "class.key").code
        pupils = []
        for robot in robots_of(board):
            origin = robot["address"]
            with httpx.Client(base_url=origin, headers={"origin": origin}) as phone:
                phone.post("/api/pair", json={"token": code}).raise_for_status()
                cookie = "; ".join(f"{name}={value}" for name, value in phone.cookies.items())
            options = {"additional_headers": {"Cookie": cookie}, "origin": origin}
            url = origin.replace("http", "ws", 1) + "/ws/drive"
            pupils.append(leaving.enter_context(Pilot(url, sees=True, **options)))
        list(pool.map(teach, pupils))
        list(pool.map(hand_over, pupils))
        httpx.post(f"{board}/api/stop", json={})
        list(pool.map(lambda pupil: pupil.wait_for_state(emergency=True), pupils))
        wait_until(lambda: all(one["emergency"] for one in robots_of(board)), "the board knows")
        process.kill()
        wait_until(lambda: running(tmp_path) == [], "a killed class leaves no robot behind")
