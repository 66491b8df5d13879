"""A robot's side of a class: `/api/class`, for the board's requests. See docs/reference/http.md."""

from __future__ import annotations

import hashlib
import secrets
import ssl
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Depends, HTTPException, Request

from robot.devices.raw_value import RawValue, must_be, text
from robot.errors import NotFoundError
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing, Sessions
from server.board.class_key import endpoint, read_class_key
from server.board.classroom import LOCKS, TEACHER, Classroom
from server.gateway.guard import role_of
from server.gateway.roles import Refusal, Role, Session
from server.routes.answers import Route
from server.routes.bodies import Key, Short, do
from server.services import Extension, Services, services_of

router = APIRouter(prefix="/api/class", route_class=Route)
_SIGNED_OUT = 10
"""Maximum number of sign-outs of all phones that can be undone."""


def _require_teacher(request: Request) -> None:
    if role_of(request) is not TEACHER:
        raise HTTPException(403, "Only the board of this robot's class may do that.")


ONLY_TEACHER = Depends(_require_teacher)


class ClassHello(RawValue):
    """A request's body: the board's random number."""

    nonce: str = text()


class ClassJoin(ClassHello):
    """A request's body: the board's proof that it knows the class key."""

    board_nonce: str = text()
    proof: str = text()


class ClassLocks(RawValue):
    """A request's body: the locks. Each lock forbids pupils some changes."""

    locks: list[Short] = must_be(f"a list of some of {', '.join(LOCKS)}")


@router.post("/hello", responses={404: {}, 409: {}})
async def hello(request: Request, body: ClassHello) -> dict[str, str]:
    """Begin the handshake; the robot is the first to prove that it knows the key."""
    now_s = services_of(request).robot.clock.now_s()
    nonce, proof = _classroom(request).challenge(body.nonce, _own(request), now_s)
    return {"nonce": nonce, "proof": proof}


@router.post("/join", responses={403: {}, 404: {}})
async def join(request: Request, body: ClassJoin) -> dict[str, str]:
    """Complete the handshake, and open a session for the board."""
    now_s = services_of(request).robot.clock.now_s()
    given = (body.board_nonce, body.nonce, body.proof)
    secret = _classroom(request).admit(*given, _own(request), now_s)
    if secret is None:
        raise HTTPException(403, "This robot's class key differs from the board's.")
    return {"secret": secret}


@router.get("", dependencies=[ONLY_TEACHER])
async def describe_class(request: Request) -> dict[str, Any]:
    """Return the robot's id, name, colour, locks and model, and its data for the board."""
    services, classroom = services_of(request), _classroom(request)
    identity, persistence = services.identity.now, services.persistence
    return {
        "id": classroom.id,
        "run": classroom.run,
        "name": identity.name,
        "colour": identity.colour,
        "locks": sorted(classroom.locks),
        "model": persistence.autosave.name if persistence is not None else None,
        "shown": services.shown(),
        "needs_pairing": not services.gateway.admits_all,
    }


@router.put("/locks", dependencies=[ONLY_TEACHER])
async def lock(request: Request, body: ClassLocks) -> dict[str, Any]:
    """Replace the locks by those in the request."""
    classroom = _classroom(request)
    await do(classroom.lock, body.locks)
    locks = sorted(classroom.locks)
    services_of(request).hub.broadcast.announce("locked", locks=locks)
    return {"locks": locks}


@router.post("/invitation", dependencies=[ONLY_TEACHER])
async def invite(request: Request) -> dict[str, Any]:
    """Return a token for the QR code on the board; null if phones need not be paired."""
    services = services_of(request)
    pairing = _pairing(services)
    if pairing is None:
        return {"token": None, "valid_s": None}
    token, valid_s = pairing.invite(services.robot.clock.now_s())
    return {"token": token, "valid_s": valid_s}


@router.delete("/phones", dependencies=[ONLY_TEACHER])
async def sign_out(request: Request) -> dict[str, Any]:
    """Sign out all phones that a code of this class has paired; return a key to undo it."""
    services = services_of(request)
    pairing = _pairing(services)
    ended = pairing.sign_out_invited() if pairing is not None else {}
    key = services.extension(ClassroomExtension).keep_signed_out(ended)
    if isinstance(services.gateway, NetworkGateway):
        sockets = services.gateway.admission.sockets
        for place in sockets:
            if place.person in ended:
                sockets.end(place)
    return {"undo": key, "phones": len(ended)}


@router.post("/phones", dependencies=[ONLY_TEACHER])
async def sign_in(request: Request, body: Key) -> dict[str, Any]:
    """Sign phones in again. The request's body contains the key that their sign-out returned."""
    services = services_of(request)
    sessions = services.extension(ClassroomExtension).take_signed_out(body.undo)
    pairing = _pairing(services)
    if pairing is not None:
        pairing.sign_in(sessions)
    return {"phones": len(sessions)}


def _pairing(services: Services) -> Pairing | None:
    return getattr(services.gateway, "pairing", None)


def _classroom(request: Request) -> Classroom:
    classroom = services_of(request).extension(ClassroomExtension).classroom
    if classroom is None:
        raise HTTPException(404, "This robot is in no class: start it with --class-key FILE.")
    return classroom


def _own(request: Request) -> str:
    """Return the robot's own address; it comes from the socket, so no header can forge it."""
    address, port = request.scope.get("server") or ("", 0)
    own = endpoint(str(address), int(port or 0))
    files = services_of(request).gateway.tls_files
    if files is None:
        return own
    chain = Path(files[1]).read_text("ascii")
    first = chain[: chain.index(ssl.PEM_FOOTER) + len(ssl.PEM_FOOTER)]
    return f"{own} {hashlib.sha256(ssl.PEM_cert_to_DER_cert(first)).hexdigest()}"


class ClassroomExtension(Extension):
    """Makes a robot part of a class; `classroom` is None if the robot belongs to no class.

    `options` may have `class_key`, the file of the key; otherwise a ready `classroom` may be given.
    """

    routers = (router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        services.gateway.public_paths |= {"/api/class/hello", "/api/class/join"}
        file: Path | None = options.get("class_key")
        self.classroom: Classroom | None = options.get("classroom")
        if file is not None:
            self.classroom = Classroom(read_class_key(file), services.config.data / "class.json")
        self._services = services
        self._signed_out: dict[str, Sessions] = {}
        if self.classroom is None:
            return
        services.gateway.credentials.append(self._recognise)
        services.gateway.checks.append(self._check)
        services.gateway.protected.add(TEACHER.value)

    def keep_signed_out(self, sessions: Sessions) -> str:
        """Remember ended sessions, so that they can be restored; return a key for them."""
        key = secrets.token_hex(8)
        self._signed_out = dict([*self._signed_out.items(), (key, sessions)][-_SIGNED_OUT:])
        return key

    def take_signed_out(self, key: str) -> Sessions:
        """Return the sessions that were remembered under a key, and forget them. Raises
        NotFoundError if the key is unknown."""
        if key not in self._signed_out:
            raise NotFoundError("this sign-out was already undone, or was too long ago")
        return self._signed_out.pop(key)

    def start(self) -> None:
        """Let phones pair with the class's code. The caller must have opened the gateway, which
        creates the pairing."""
        pairing = _pairing(self._services)
        if self.classroom is not None and pairing is not None:
            pairing.standing_code = self.classroom.code

    def _recognise(self, headers: Mapping[str, str]) -> Session | None:
        assert self.classroom is not None
        if not self.classroom.knows(headers.get("authorization", "")):
            return None
        return Session(TEACHER, TEACHER.value)  # the limits count all boards together

    def _check(self, path: str, method: str | None, role: Role) -> Refusal | None:
        assert self.classroom is not None
        if role is TEACHER or not self.classroom.is_locked(path, method):
            return None
        return Refusal(423, "locked", "The teacher has locked this.")
