"""Middleware that every request and every websocket passes before it reaches a route.

It checks Host, Origin, size, rate and role, refuses with a status and a sentence, and adds the
security headers. Who only watches may read: any other method is a pilot's or the teacher's.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, HTTPConnection
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robot.clock import Clock
from server.access.admission import AdmissionControl, ConnectionLimiter, Peer, Slot, address_key
from server.access.proxies import PEER, PREFIX, Proxies
from server.access.rules import Access, Refusal, Role, Session, host_name
from server.access.unknown_name import explain_unknown_name

log = logging.getLogger(__name__)

STOP_PATH = "/api/stop"
"""The emergency stop for a page without a websocket."""
_PARTS = ("/js/", "/css/", "/icons/")
_ROLE, _PERSON, _PLACE = "drivelesson.role", "drivelesson.person", "drivelesson.place"
_UPLOADS = re.compile(r"/api/models/[^/]+/file")
"""Paths whose bodies may be as large as a model."""
_TOO_LARGE = Refusal(413, "size", "That is too large.")
_TOO_MANY_S = 0.5
_LASTING = "/video.mjpg"
"""A request that lasts as a websocket does, and is counted as one."""


def role_of(connection: HTTPConnection) -> Role:
    """Return what the browser behind a request or websocket may do."""
    role = connection.scope.get(_ROLE)
    return role if isinstance(role, Role) else Role.VIEWER


def person_of(connection: HTTPConnection) -> str:
    """Return what the client is counted by: its session, or its address."""
    return str(connection.scope.get(_PERSON, ""))


def note_use(scope: Scope, now_s: float) -> None:
    """Note that a websocket is in use; of two of one person the idle one goes first."""
    place = scope.get(_PLACE)
    if isinstance(place, Slot):
        place.used_s = now_s


@dataclass(frozen=True)
class Guard:
    """ASGI middleware around the whole application; it counts in `refused`, by reason."""

    app: ASGIApp
    access: Access
    refused: Counter[str]
    clock: Clock
    admission: AdmissionControl
    proxies: Proxies

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        seen = self.proxies.see_through(scope)
        scope = scope if isinstance(seen, Refusal) else seen
        headers = _headers(scope)
        verdict = seen if isinstance(seen, Refusal) else self._judge(scope, headers)
        if isinstance(verdict, Refusal):
            self.refused[verdict.reason] += 1
            path, why = str(scope["path"])[:80], verdict.sentence
            log.warning("refused reason=%s path=%r why=%r", verdict.reason, path, why)
            if verdict.status == 429:  # who waits for the answer asks no more meanwhile
                await self.clock.pause(_TOO_MANY_S)
            await _refuse(scope, receive, send, verdict)
            return
        scope[_ROLE] = verdict
        try:
            if scope["type"] == "websocket":
                await self.app(scope, receive, send)
            else:
                await self._pass_request(scope, receive, send, headers)
        except asyncio.CancelledError:
            if _PLACE not in scope or scope[_PLACE].is_taken:
                raise
            await _close(scope, send)  # another needed the place more
        finally:
            if _PLACE in scope:
                self.admission.sockets.give_back(scope[_PLACE])
                self.admission.uploads.give_back(scope[_PLACE])

    def _judge(self, scope: Scope, headers: dict[str, str]) -> Role | Refusal:
        access, method, now_s = self.access, scope.get("method"), self.clock.now_s()
        address, _ = tuple(scope.get("client") or ("", 0))
        peer = _peer(scope)
        scheme = "https" if scope["scheme"] in ("https", "wss") else "http"
        is_lasting = scope["type"] == "websocket" or scope["path"] == _LASTING
        refusal = access.check_host(headers) or access.check_origin(headers, scheme, method)
        session = None if refusal else access.session_of(headers, address_key(address))
        line = session
        if PEER in scope:  # a proxy's connections may each carry many people's requests
            line = Session(Role.VIEWER, f"proxy {peer[0]}", is_crowd=True)
        self.admission.asked(peer, line, now_s, lasts=is_lasting)
        if refusal is not None:
            return refusal
        if scope["path"] == STOP_PATH and session is not None:
            return session.role  # a stop passes before all limits
        person = session or Session(Role.VIEWER, address_key(address))
        scope[_PERSON] = person.name
        refusal = self._check_limits(scope, headers, person)
        verdict = refusal or access.admit(scope["path"], method, headers, session)
        is_upload = method == "PUT" and _UPLOADS.fullmatch(scope["path"])
        places = (
            self.admission.sockets if is_lasting else self.admission.uploads if is_upload else None
        )
        if places is None or isinstance(verdict, Refusal):
            return verdict
        return self._seat(places, scope, person) or verdict

    def _check_limits(
        self, scope: Scope, headers: dict[str, str], person: Session
    ) -> Refusal | None:
        if "\0" in scope["path"]:
            return Refusal(400, "path", "This address is not valid.")
        if not self.admission.may_ask(person, self.clock.now_s()):
            return Refusal(429, "rate", "Too many requests; wait a little.")
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length[:20]) > self._most_bytes(scope):
            return _TOO_LARGE
        return None

    def _seat(self, places: ConnectionLimiter, scope: Scope, person: Session) -> Refusal | None:
        """Take a place for what lasts; it ends when it has to give the place up."""
        task = asyncio.current_task()
        assert task is not None
        place = places.take(person, self.clock.now_s(), task.cancel)
        if place is None:
            return Refusal(503, "clients", "Too many pages are open, or models on their way.")
        scope[_PLACE] = place
        return None

    def _most_bytes(self, scope: Scope) -> int:
        is_upload = scope["type"] == "http" and _UPLOADS.fullmatch(scope["path"])
        limits = self.admission.limits
        return limits.upload_bytes if is_upload else limits.body_bytes

    async def _pass_request(
        self, scope: Scope, receive: Receive, send: Send, sent: dict[str, str]
    ) -> None:
        extra = _security_headers(scope["scheme"], sent.get("host", ""), scope["path"])

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message.setdefault("headers", [])
                headers = MutableHeaders(scope=message)
                for name, value in extra.items():
                    headers.setdefault(name, value)
            await send(message)
            if message["type"] == "http.response.body" and not message.get("more_body", False):
                self.admission.answered(_peer(scope), self.clock.now_s())

        try:
            await self.app(scope, _limited(receive, self._most_bytes(scope)), send_guarded)
        except ClientDisconnect:  # gone in the middle of its body, or that was cut off
            await _refuse(scope, receive, send, _TOO_LARGE)


def _limited(receive: Receive, most: int) -> Receive:
    """End a body that is longer than allowed, whatever its header says."""
    total = 0

    async def receive_limited() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > most:
            return {"type": "http.disconnect"}
        return message

    return receive_limited


def _peer(scope: Scope) -> Peer:
    """Return who is at the other end of the connection: the client, or its proxy."""
    peer: Peer = scope.get(PEER) or tuple(scope.get("client") or ("", 0))
    return peer


def _headers(scope: Scope) -> dict[str, str]:
    """Return the request's headers; the first of a repeated one, except that cookies are joined."""
    headers = Headers(scope=scope)
    return {**headers, "cookie": "; ".join(headers.getlist("cookie"))}


def _security_headers(scheme: str, host: str, path: str) -> dict[str, str]:
    """Return the security headers. Only documents and workers need a content policy: scripts,
    styles and icons run under the policy of the document that loads them."""
    headers = {
        "x-content-type-options": "nosniff",
        "cross-origin-resource-policy": "same-origin",
        "cache-control": "no-cache",
    }
    if path.startswith(_PARTS) and not path.endswith("-worker.js"):
        return headers
    return {
        **headers,
        "content-security-policy": content_policy(scheme, host),
        "x-frame-options": "DENY",
        "referrer-policy": "no-referrer",
        "cross-origin-opener-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=()",
    }


def content_policy(scheme: str, host: str, inline: Iterable[str] = ()) -> str:
    """Return a document's content policy; `inline` are hashes of the scripts and styles in it."""
    socket = f"{'wss' if scheme == 'https' else 'ws'}://{host}"
    own = " ".join(["'self'", *inline])
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src {own}",
            f"style-src {own}",
            "img-src 'self' blob: data:",
            "media-src 'self' blob:",
            "font-src 'self'",
            f"connect-src 'self' {socket}",
            "worker-src 'self'",
            "manifest-src 'self'",
            "base-uri 'none'",
            "form-action 'self'",
            "frame-ancestors 'none'",
        ]
    )


async def _close(scope: Scope, send: Send) -> None:
    """End what had to give up its place."""
    task = asyncio.current_task()
    if task is not None:
        task.uncancel()
    with contextlib.suppress(Exception):  # it may be closed already
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1013})
        else:
            await send({"type": "http.response.body", "body": b""})


def _say(refusal: Refusal, asked: Headers, headers: dict[str, str]) -> Response:
    """Return the answer that says why: a page where a person opened an unknown name."""
    if refusal.reason == "host" and "text/html" in asked.get("accept", ""):
        name = host_name(asked.get("host", ""))[:80]
        page = explain_unknown_name(name, refusal.open_at, asked.get("accept-language", ""))
        headers["content-security-policy"] = "default-src 'none'"
        return HTMLResponse(page, refusal.status, headers)
    told = {"error": refusal.reason, "detail": refusal.sentence}
    return JSONResponse(told, refusal.status, headers)


async def _refuse(scope: Scope, receive: Receive, send: Send, refusal: Refusal) -> None:
    """Answer with a status; a websocket gets a plain 403 where the server supports no other."""
    kind = scope["type"]
    if kind == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    prefix = "websocket.http.response" if kind == "websocket" else "http.response"
    headers = {"cache-control": "no-store", "x-content-type-options": "nosniff"}
    if refusal.location is not None:
        headers["location"] = scope.get(PREFIX, "") + refusal.location
    answer = _say(refusal, Headers(scope=scope), headers)
    start = {"status": answer.status_code, "headers": answer.raw_headers}
    await send({"type": f"{prefix}.start", **start})
    await send({"type": f"{prefix}.body", "body": answer.body})
