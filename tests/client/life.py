"""One life of a served robot: it starts on a folder, random things happen, and it is killed.

Everything runs in virtual time in one process, which is really killed (SIGKILL) by its parent or at
a call of the disk. Each answer is reported to the parent before the next step begins.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx

from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.prepare import prepare
from robot.testing import FakeCamera, FakeDriver, LinkConditions
from robot.types import Action
from server.access.config import NetworkConfig, NetworkLimits
from server.access.pairing import Pairing, cookie_name
from server.gateway.roles import Role
from server.identity import IdentityFile
from tests.client.bodies import Pool, Requests, Route
from tests.client.commands import Command
from tests.client.disk import Disk
from tests.client.facts import GROUPS, Facts, lost, read
from tests.kit.green_clock import GreenClock
from tests.server.live_robot import WEB
from tests.server.test_fuzz import drive_message
from tests.server.virtual_server import VirtualPilot, VirtualServer

WATCHED_S = 0.5
"""Longest time after its pilot's last message for which a wheel may turn, in seconds."""
_MANY = 10**9
RATE_HZ = 12.0
LATE_S = 2.0
"""Longest delay of a message on a disturbed link, in seconds."""
_LATER = 40
"""Number of steps for which a life waits for the disk call that ends it."""
LIMITS = NetworkLimits(
    messages_per_second=_MANY,
    messages_burst=_MANY,
    requests_per_second=_MANY,
    requests_burst=_MANY,
    refused_before_closing=_MANY,
    pairing_failures=_MANY,
)
TOUCHED = (
    ("/api/models", ("models", "learner")),
    ("/api/teaching", ("learner",)),
    ("/api/gallery", ("learner",)),
    ("/api/retraining", ("models", "learner")),
    ("/api/settings", ("models", "learner", "identity")),
    ("/api/episodes", ("episodes",)),
    ("/api/trash", ("episodes", "models")),
    ("/api/session", ("models", "learner", "episodes")),
    ("/api/studies", ("models", "learner", "episodes")),
    ("/api/pair", ("sessions",)),
)
"""The parts of the state that a request may change, by the beginning of its path."""
SPOKEN_OF = {"drive_fault": "driver", "camera_fault": "camera", "loop_fault": "sleep"}
"""For each reason of a stop, the event without which the robot must not give this reason."""
PEOPLE = ("owner", "pupil", "viewer")
Tell = Callable[[dict[str, Any]], None]


class Page:
    """A browser; the life notes the time of each message that it sends."""

    def __init__(self, life: Life, person: str) -> None:
        self._life = life
        self.pilot = VirtualPilot(life.server, headers=life.cookies[person])
        real = self.pilot.page.send

        def send(**message: Any) -> None:
            self.note_said()
            real(**message)

        self.pilot.page.send = send  # type: ignore[method-assign]
        self.note_said()

    def note_said(self) -> None:
        client = str(self.pilot.page.hello["client"])
        self._life.said_s[client] = self._life.server.clock.now_s()


class Errors(logging.Handler):
    """Collects the errors that the server logs."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(self.format(record))


def make_rig() -> Rig:
    """Return a robot in virtual time whose camera gives few pictures, which costs less."""
    clock = GreenClock(100.0)
    camera = FakeCamera(clock, rate_hz=RATE_HZ)
    return Rig(FakeDriver(clock=clock), camera, make_policy("published-8"), clock)


def describe(folder: Path) -> dict[str, Any]:
    """Return the routes' description; this also loads all modules that every life needs."""
    with VirtualServer(data=folder, rig=make_rig()) as server:
        server.forward(0.1)
        spec: dict[str, Any] = server.app.openapi()
        page = server.pilot()
        page.mode("train")
        page.hold("forward")
        server.forward(1.0)
        requests = Requests(spec, random.Random(1), Pool())
        for route in requests.routes:
            if "zip" in route.path or route.path == "/api/unpair":
                continue
            body = requests.body(route)
            named = {"content": body} if isinstance(body, bytes) else {"json": body}
            url = server.address + requests.target(route)
            request = httpx.Request(route.method, url, **named)  # type: ignore[arg-type]
            with contextlib.suppress(AssertionError):  # an endless answer
                server.request(request).close()
        page.close()
        for kind in ("list", "show", "title", "zip"):
            Command(random.Random(1), Pool(), folder, kind).run()
    return spec


class Life:
    """Runs steps until it is killed, or has done all of them.

    Args:
        root: The data folder, as the last life left it.
        secrets: Of the paired browsers, by name.
        wanted: What was answered: groups that are missing are not known.
        tell: Tells the parent.
        spec: The description of the routes.
    """

    def __init__(
        self,
        root: Path,
        seed: int,
        secrets: dict[str, str],
        wanted: Facts,
        tell: Tell,
        spec: dict[str, Any],
    ) -> None:
        self.spec = spec
        self.root, self.dice, self.secrets = root, random.Random(seed), secrets
        self.wanted, self.tell = wanted, tell
        self.disk = Disk(root)
        self.caused: Counter[str] = Counter()
        self.pages: list[Page] = []
        self.said_s: dict[str, float] = {}
        """When each client last said something."""
        self.released: set[int] = set()
        """The numbers of the STOPs that somebody has released who had seen them."""
        self._was_emergency = False
        self._driver_id = ""
        self._bad_s = 0.0
        self._was_latched = False
        self.step = self.kind = "start"
        self.errors = Errors()
        self._steps: list[tuple[Callable[[], None], int]] = [
            (self.ask, 25),
            (self.drive, 30),
            (self.set_off, 10),
            (self.talk, 12),
            (self.come_or_go, 8),
            (self.pass_time, 20),
            (self.stop, 4),
            (self.release, 4),
            (self.pair, 2),
            (self.disturb_link, 3),
            (self.disturb_body, 3),
            (self.disturb_disk, 3),
            (self.sleep, 1),
            (self.command, 2),
        ]

    def run(self, steps: int, *, dies: bool) -> None:
        """Start, compare with the answers so far, and do the steps.

        If it `dies`, a call of the disk after the steps is the last action of this process.
        """
        self.disk.install()
        logging.getLogger().addHandler(self.errors)
        logging.getLogger().setLevel(logging.WARNING)
        self.tell({"begin": list(GROUPS), "step": "start", "keeps": True})
        prepare(self.root)
        pairing = Pairing(_MANY, file=self.root / "paired.json")
        config = NetworkConfig(
            port=0, web=WEB, lan=True, data=self.root, limits=LIMITS, host="127.0.0.1"
        )
        with VirtualServer(
            config, pairing=pairing, data=self.root, rig=make_rig(), name="bench"
        ) as server:
            self.server, self.pairing = server, pairing
            identity = server.services.identity
            identity._path = self.root / "robot.json"
            if (saved := IdentityFile(self.root).now) is not None:
                identity.now = saved
            server.persistence.autosave.load_last()
            name = cookie_name(server.services.gateway.config)  # type: ignore[arg-type]
            self.cookies = {
                person: {"cookie": f"{name}={secret}"} for person, secret in self.secrets.items()
            } | {"stranger": {}}
            server.forward(0.5)
            if (writer := server.persistence.writer._writer) is not None:
                writer._files = self.disk.lay_beneath(writer._files)
            found = read(server, self.secrets, GROUPS)
            for sentence in lost(self.wanted, found):
                self.violate(sentence)
            self.wanted = found
            self.tell({"facts": found})
            self.pool = Pool()
            self.requests = Requests(self.spec, self.dice, self.pool)
            self.pool.model = self._export()
            server.rig.loop.subscribe(self.watch)
            calls, weights = zip(*self._steps, strict=True)
            for number in range(steps + _LATER * dies):
                if dies and number == steps:
                    self.disk.kill(self.dice.randrange(12))
                [call] = self.dice.choices(calls, weights)
                self.step = self.kind = call.__name__
                call()
                self.check()
                self.tell({"done": number, "kind": self.kind, "moves": self._moves()})
            self.disk.heal()
            for page in self.pages:
                page.pilot.vanish()

    def violate(self, sentence: str) -> None:
        self.tell({"violation": f"{self.step}: {sentence}"})

    # Invariants --------------------------------------------------------------------------------

    def watch(self, tick: Tick) -> None:
        """Check each tick, on the loop's thread."""
        drivers = {one.pilot for one in tick.commands}
        if len(drivers) > 1:
            self.violate(f"two drivers in one tick: {sorted(drivers)}")
        if drivers:
            self._driver_id = drivers.pop()
        self._was_latched |= tick.emergency
        if self._was_emergency and not tick.emergency:
            number = self.server.hub.emergency.number
            if number not in self.released:
                self.violate(f"STOP {number} was undone, which nobody has released")
        self._was_emergency = tick.emergency
        now_s = self.server.clock.now_s()
        if tick.sent is not Action.STOP:
            if tick.emergency:
                self.violate("an order to move after a STOP")
            drivers = {self._driver_id, self.server.hub.lease.owner or ""}
            said_s = max(self.said_s.get(one, -1.0) for one in drivers)
            if now_s - said_s > WATCHED_S:
                self.violate(f"an order to move {now_s - said_s:.2f} s after the pilot")
        reason = tick.decision.stop_reason
        cause = SPOKEN_OF.get(reason.value) if reason is not None else None
        if reason is not None and cause is not None and not self.caused[cause]:
            self.violate(f"{reason.value} is said, but nothing of the kind happened")

    def check(self) -> None:
        """Check after each step."""
        state, driver = self.server.rig.loop.state, self.server.driver
        if driver.now is not Action.STOP:
            if state.emergency:
                self.violate("the wheels turn after a STOP")
            said_s = max(self.said_s.values(), default=-1.0)
            if self.server.clock.now_s() - said_s > WATCHED_S:
                self.violate("the wheels turn without a pilot")
        if state.fault is not None and not self.caused:
            self.violate(f"a fault is said without cause: {state.fault}")
        found, self.errors.found = self.errors.found, []
        for line in found:
            self.violate(f"logged: {line}")

    # Steps ---------------------------------------------------------------------------------------

    def ask(self) -> None:
        """Send any request by anybody."""
        route = self.dice.choice(self.requests.routes)
        if route.path in ("/api/unpair", "/api/stop") or "zip" in route.path:
            return
        person = self.dice.choice(["owner", "owner", "owner", "pupil", "viewer", "stranger"])
        self._know()
        self.request(route, self.cookies[person])

    def request(self, route: Route, headers: dict[str, str]) -> httpx.Response:
        """Send one request, and check its answer."""
        path, body = self.requests.target(route), self.requests.body(route)
        self.step = f"{route.method} {path} {body if not isinstance(body, bytes) else '(file)'}"
        changes = route.method != "GET"
        touched = next((groups for start, groups in TOUCHED if path.startswith(start)), ())
        touched = touched if changes else ()
        self.tell({"begin": list(touched), "step": self.step})
        answer = self._send(route.method, path, body, headers)
        self.kind = f"{route.method} {answer.status_code}"
        if answer.status_code >= 500:
            is_explained = answer.status_code == 507 and self.disk.is_failing
            if not (is_explained or answer.status_code == 503):
                self.violate(f"answered {answer.status_code}: {answer.text[:300]}")
        told = _json(answer)
        self._learn(told)
        if answer.status_code >= 400 and answer.status_code != 404 and not told:
            self.violate(f"answered {answer.status_code} without a sentence")
        if touched:
            self._judge(touched, answer, told)
        return answer

    def _judge(self, touched: tuple[str, ...], answer: httpx.Response, told: Any) -> None:
        is_kept = not isinstance(told, dict) or told.get("kept") is not False
        self._note(touched, str(answer.status_code), is_done=answer.is_success, is_kept=is_kept)

    def _note(
        self, touched: tuple[str, ...], status: str, *, is_done: bool, is_kept: bool = True
    ) -> None:
        """Note what is kept once something was answered."""
        if not (is_done and is_kept) and (self.disk.is_failing or is_done):
            for group in touched:  # some of it may have been done
                self.wanted.pop(group, None)
            self.tell({"unknown": list(touched)})
            return
        if not is_done:  # what was not known before is not known by a refusal
            touched = tuple(group for group in touched if group in self.wanted)
        found = read(self.server, self.secrets, touched)
        if not is_done:
            before = {group: self.wanted[group] for group in touched}
            for sentence in lost(before, found):
                self.violate(f"a refusal ({status}) changed {sentence}")
        self.wanted.update(found)
        self.tell({"facts": found})

    def set_off(self) -> None:
        """End all faults; then a page makes the robot move, if it may."""
        if self._is_link_bad():
            self._bad_s = self.server.clock.now_s()
        self.server.link.conditions = LinkConditions()
        self._heal_body()
        page = self._page()
        if page is None:
            self.come_or_go()
            return
        self.released.add(self.server.hub.emergency.number)
        self.server.rig.loop.release_emergency()
        page.pilot.is_silent = False
        page.pilot.send(type="take")
        self.server.forward(0.1)
        page.pilot.mode(self.dice.choice(["train", "train", "autonomous"]))
        page.pilot.hold(self.dice.choice(["forward", "left", None]))
        self.server.forward(self.dice.choice([0.05, 0.3]))

    def drive(self) -> None:
        """Have a page hold, let go, or choose a mode."""
        page = self._page()
        if page is None:
            return
        what = self.dice.randrange(6)
        if what == 0:
            page.pilot.mode(self.dice.choice(["train", "train", "autonomous", "stopped"]))
        elif what == 1:
            page.pilot.hold(None)
        elif what == 2:
            page.pilot.is_silent = not page.pilot.is_silent
        else:
            page.pilot.hold(self.dice.choice(["forward", "left", "right"]))
        self.server.forward(self.dice.choice([0.0, 0.02, 0.1]))

    def talk(self) -> None:
        """Send any message, valid or nonsense."""
        page = self._page()
        if page is None:
            return
        kind = self.dice.randrange(3)
        if kind == 0:
            message = drive_message(self.dice)

            async def send() -> None:
                page.note_said()
                page.pilot.page.socket.send(message)

            self.server.run(send())
        else:
            page.pilot.send(type=self.dice.choice(["take", "yield", "ping", "idle", "watch"]))
        self.server.forward(0.0)

    def come_or_go(self) -> None:
        """Open or close a tab, or kill its browser."""
        open_pages = [page for page in self.pages if not page.pilot.page.socket.is_closed]
        if len(open_pages) < 4 and self.dice.random() < 0.6 and not self._is_link_bad():
            self.pages.append(Page(self, self.dice.choice(PEOPLE)))
        elif open_pages:
            page = self.dice.choice(open_pages)
            (page.pilot.close if self.dice.random() < 0.5 else page.pilot.vanish)()
        self.pages = [one for one in self.pages if not one.pilot.page.has_ended][-6:]

    def pass_time(self) -> None:
        self.server.forward(self.dice.choice([0.03, 0.03, 0.1, 0.3, 1.0]))

    def stop(self) -> None:
        """Anybody's STOP is obeyed: within 100 ms, or when late messages have arrived."""
        is_late = self._was_latched = False
        socket = None
        if self.dice.random() < 0.5:
            person = self.dice.choice(PEOPLE)
            answer = self._send("POST", "/api/stop", None, self.cookies[person])
            if not answer.is_success:
                self.violate(f"a STOP was answered {answer.status_code}")
        else:
            page = self._page()
            if page is None or self._is_link_bad():
                return
            socket = page.pilot.page.socket
            page.pilot.send(type="stop")
            is_late = self.server.clock.now_s() - self._bad_s < LATE_S
        self.server.forward(LATE_S if is_late else 0.1)
        if socket is not None and socket.is_closed:
            return  # the connection had ended: a page says it again on the next one
        if not self._was_latched:  # a release that was late may have come since
            self.violate(f"a STOP was not obeyed (late: {is_late})")

    def release(self) -> None:
        page = self._page()
        if page is None:
            return
        self.released.add(page.pilot.page.state["stop_number"])
        is_late = not self._is_link_bad() and self.dice.random() < 0.3
        if is_late:
            self._bad_s = self.server.clock.now_s()
            self.server.link.conditions = LinkConditions(delay_s=self.dice.uniform(0.05, 0.3))
        page.pilot.release()
        if is_late:  # a newer STOP, which goes another way
            self.server.link.conditions = LinkConditions()
            self._send("POST", "/api/stop", None, self.cookies[self.dice.choice(PEOPLE)])
        self.server.forward(0.35 if is_late else 0.05)

    def pair(self) -> None:
        """Pair another browser, or unpair it."""
        more = [name for name in self.secrets if name.startswith("more")]
        self.tell({"begin": ["sessions"], "step": "pair"})
        if len(more) > 3:
            name = self.dice.choice(more)
            answer = self._send("POST", "/api/unpair", None, self.cookies[name])
        else:
            token = {"token": self.pairing.tokens[self.dice.choice([Role.PILOT, Role.VIEWER])]}
            name = f"more {self.dice.randrange(10**6)}"
            answer = self._send("POST", "/api/pair", token, {})
            cookie = answer.headers.get("set-cookie", "").split(";")[0]
            if answer.is_success:
                self.secrets[name] = cookie.partition("=")[2]
                self.cookies[name] = {"cookie": cookie}
                self.tell({"secret": [name, self.secrets[name]]})
        self._judge(("sessions",), answer, _json(answer))
        if len(more) > 3 and "sessions" in self.wanted:
            del self.secrets[name], self.wanted["sessions"][name]
            self.tell({"secret": [name, ""], "facts": {"sessions": self.wanted["sessions"]}})

    def disturb_link(self) -> None:
        link, dice = self.server.link, self.dice
        self._bad_s = self.server.clock.now_s()
        self.caused["link"] += 1
        link.conditions = dice.choice(
            [
                LinkConditions(),
                LinkConditions(),
                LinkConditions(delay_s=dice.uniform(0.0, 0.6)),
                LinkConditions(delay_s=0.05, jitter_s=0.4),
                LinkConditions(is_silent=True),
                LinkConditions(stall_share=0.2, stall_s=0.5),
            ]
        )

    def disturb_body(self) -> None:
        server, what = self.server, self.dice.randrange(4)
        self._heal_body()
        if what == 0:
            self.caused["driver"] += 1
            server.driver.failure = "The left motor does not answer."
        elif what == 1:
            self.caused["camera"] += 1
            server.camera.is_frozen = True
        elif what == 2:
            self.caused["camera"] += 1
            server.camera.break_down("The camera was unplugged.")

    def _heal_body(self) -> None:
        self.server.driver.failure = None
        self.server.camera.is_frozen = False

    def disturb_disk(self) -> None:
        self.disk.heal()
        if self.dice.random() < 0.6:
            self.caused["disk"] += 1
            why = self.dice.choice([errno.EIO, errno.ENOSPC, errno.EROFS])
            self.disk.fail(self.dice.randrange(8), lasts=self.dice.random() < 0.5, why=why)
        else:
            self.server.forward(1.5)

    def sleep(self) -> None:
        """The computer sleeps; nothing may move when it wakes."""
        self.caused["sleep"] += 1
        self.server.clock.advance(self.dice.choice([0.4, 5.0, 3600.0]))
        before = self.server.driver.moved_s
        self.server.forward(0.0)
        if self.server.driver.moved_s != before and self.server.driver.now is not Action.STOP:
            self.violate("it moves when its computer wakes")

    def command(self) -> None:
        """A call of the command line, beside the server."""
        self._know()
        command = Command(self.dice, self.pool, self.root)
        self.step = "drivelesson " + " ".join(command.words[:-2])
        touched = ("episodes",) if command.changes else ()
        self.tell({"begin": list(touched), "step": self.step})
        status, last = command.run()
        self.kind = f"episodes {command.kind} {status}"
        if "Traceback" in last or (status and not last.strip()):
            self.violate(f"ended with {status} and said {last!r}")
        self._note(touched, str(status), is_done=status == 0)
        if status == 0 and touched and "episodes" in self.wanted:
            untrue = command.untrue(self.wanted["episodes"])
            if untrue is not None:
                self.violate(untrue)

    def _moves(self) -> bool:
        return self.server.driver.now is not Action.STOP

    # Help ----------------------------------------------------------------------------------------

    def _page(self) -> Page | None:
        pages = [page for page in self.pages if not page.pilot.page.socket.is_closed]
        return self.dice.choice(pages) if pages else None

    def _is_link_bad(self) -> bool:
        return self.server.link.conditions != LinkConditions()

    def _send(self, method: str, path: str, body: Any, headers: dict[str, str]) -> httpx.Response:
        content: dict[str, Any] = {}
        if isinstance(body, bytes):
            content["content"] = body
        elif body is not None:
            content["json"] = body
        address = f"http://127.0.0.1:{self.server.port}{path}"
        answer = self.server.request(httpx.Request(method, address, headers=headers, **content))
        if "multipart" not in answer.headers.get("content-type", ""):
            answer.read()
        return answer

    def _know(self) -> None:
        """Read the existing names, to use them in requests."""
        if self.dice.random() < 0.1:
            self.pool.names = [
                *self.server.persistence.models.names(),
                "new one",
            ]
            headers = self.cookies["owner"]
            found = _json(self._send("GET", "/api/episodes", None, headers)) or {}
            self.pool.episodes = [one["id"] for one in found.get("episodes", [])]
            gallery = _json(self._send("GET", "/api/gallery", None, headers)) or {}
            self.pool.nodes = [one["node"] for one in gallery.get("images", [])]

    def _learn(self, told: Any) -> None:
        if isinstance(told, dict) and isinstance(key := told.get("undo"), str):
            self.pool.keys = [*self.pool.keys[-5:], key]

    def _export(self) -> bytes:
        with contextlib.suppress(Exception):
            names = self.server.persistence.models.names()
            return self.server.persistence.models.read_file(names[0])
        return b""


def _json(answer: httpx.Response) -> Any:
    with contextlib.suppress(ValueError, UnicodeDecodeError):
        return json.loads(answer.text)
    return None
