"""Middleware that every request and every websocket passes before it reaches a route.

The guard checks Host, Origin, size, rate and role, refuses with a status and a sentence, and adds
the security headers. A viewer may only read.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.gateway.gateway import PREFIX, SLOT, STOP_PATH, Gateway
from server.gateway.roles import Refusal, Role, Session
from server.gateway.rules import admit, check_host, check_origin

log = logging.getLogger(__name__)

_PARTS = ("/js/", "/css/", "/icons/")
_ROLE, _PERSON = "drivelesson.role", "drivelesson.person"
_UPLOADS = re.compile(r"/api/[a-z]+/[^/]+/file")
"""Paths of uploads, whose bodies may be as large as a model's file."""
_TOO_LARGE = Refusal(413, "size", "The request is too large.")
_TOO_MANY_S = 0.5
VIDEO = "/video.mjpg"
"""Path of the video stream, which stays open like a websocket and is counted as one."""


def role_of(connection: HTTPConnection) -> Role:
    """Return the role in which the guard has admitted a request or websocket."""
    role = connection.scope.get(_ROLE)
    return role if isinstance(role, Role) else Role.VIEWER


def person_of(connection: HTTPConnection) -> str:
    """Return the name by which the limits count a client: its session's name or its address."""
    return str(connection.scope.get(_PERSON, ""))


def note_use(scope: Scope, now_s: float) -> None:
    """Record that a websocket is in use; a person's least recently used one is evicted first."""
    if (slot := scope.get(SLOT)) is not None:
        slot.used_s = now_s


@dataclass(frozen=True)
class Guard:
    """ASGI middleware that checks every request."""

    app: ASGIApp
    gateway: Gateway

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        seen = self.gateway.see_through(scope)
        scope = scope if isinstance(seen, Refusal) else seen
        verdict = seen if isinstance(seen, Refusal) else self._judge(scope)
        if isinstance(verdict, Refusal):
            await self._refuse(scope, receive, send, verdict)
            return
        scope[_ROLE] = verdict
        try:
            if scope["type"] == "websocket":
                await self.app(scope, receive, send)
            else:
                await self._pass_request(scope, receive, send)
        except asyncio.CancelledError:
            if SLOT not in scope or scope[SLOT].is_taken:
                raise
            await _close(scope, send)  # the slot was evicted for another client
        finally:
            self.gateway.leave(scope)

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, refusal: Refusal) -> None:
        """Count, log and answer a refused request."""
        is_too_many, reason = refusal.status == 429, refusal.reason
        self.gateway.refused[reason] += 1
        if not is_too_many or self.gateway.may_log(scope.get(_PERSON, ""), reason):
            path, why = str(scope["path"])[:80], refusal.sentence
            log.warning("refused reason=%s path=%r why=%r", reason, path, why)
        if is_too_many:  # a pause slows down a client that waits for the answer
            await self.gateway.clock.pause(_TOO_MANY_S)
        await self._answer(scope, receive, send, refusal)

    def _judge(self, scope: Scope) -> Role | Refusal:
        """Return the role in which a request is admitted, or why it is refused."""
        gateway, headers = self.gateway, _headers(scope)
        method, path = scope.get("method"), scope["path"]
        is_lasting = scope["type"] == "websocket" or path == VIDEO
        found = self._identify(scope, headers)
        session = found if isinstance(found, Session) else None
        too_many = gateway.note_asked(scope, session, lasts=is_lasting)
        if isinstance(found, Refusal):
            return found
        if path == STOP_PATH and session is not None:
            return session.role  # the rate limit does not apply to STOP
        person = session or gateway.anonymous(_address(scope))
        scope[_PERSON] = person.name
        refusal = too_many or self._check_limits(scope, headers, person)
        verdict = refusal or admit(gateway, path, method, headers, session)
        if isinstance(verdict, Refusal):
            return verdict
        refusal = gateway.check(path, method, verdict)
        is_upload = method == "PUT" and bool(_UPLOADS.fullmatch(path))
        if refusal is None and (is_lasting or is_upload):
            task = asyncio.current_task()
            assert task is not None
            refusal = gateway.take_slot(scope, person, task.cancel, is_upload=is_upload)
        return refusal or verdict

    def _identify(self, scope: Scope, headers: dict[str, str]) -> Session | Refusal | None:
        """Return a request's session, or a refusal if a page of another site has sent it."""
        if (refusal := check_host(self.gateway, headers)) is not None:
            return refusal
        # Pages of other sites may use a URL with a key, so their Origin header is not checked.
        if (by_address := self.gateway.session_by_address(scope)) is not None:
            return by_address
        scheme = "https" if scope["scheme"] in ("https", "wss") else "http"
        refusal = check_origin(self.gateway, headers, scheme, scope.get("method"))
        return refusal or self.gateway.session_of(headers, _address(scope))

    def _check_limits(
        self, scope: Scope, headers: dict[str, str], person: Session
    ) -> Refusal | None:
        if "\0" in scope["path"]:
            return Refusal(400, "path", "This address is not valid.")
        if not self.gateway.may_ask(person):
            return Refusal(429, "rate", "Too many requests; wait a little.")
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length[:20]) > self._most_bytes(scope):
            return _TOO_LARGE
        return None

    def _most_bytes(self, scope: Scope) -> int:
        is_upload = scope["type"] == "http" and _UPLOADS.fullmatch(scope["path"])
        limits = self.gateway.config.limits
        return limits.upload_bytes if is_upload else limits.body_bytes

    async def _pass_request(self, scope: Scope, receive: Receive, send: Send) -> None:
        host = Headers(scope=scope).get("host", "")
        extra = _security_headers(scope["scheme"], host, scope["path"])

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message.setdefault("headers", [])
                headers = MutableHeaders(scope=message)
                for name, value in extra.items():
                    headers.setdefault(name, value)
            await send(message)
            if message["type"] == "http.response.body" and not message.get("more_body", False):
                self.gateway.note_answered(scope)

        try:
            await self.app(scope, _limited(receive, self._most_bytes(scope)), send_guarded)
        except ClientDisconnect:  # the body was too long, or the client left before its end
            await self._answer(scope, receive, send, _TOO_LARGE)

    async def _answer(self, scope: Scope, receive: Receive, send: Send, refusal: Refusal) -> None:
        """Say why a request is refused; a websocket gets a plain 403 if uvicorn is too old."""
        kind = scope["type"]
        if kind == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
            await receive()
            await send({"type": "websocket.close", "code": 1008})
            return
        prefix = "websocket.http.response" if kind == "websocket" else "http.response"
        headers = {"cache-control": "no-store", "x-content-type-options": "nosniff"}
        if refusal.status == 429:
            headers["retry-after"] = "1"
        if refusal.reason == "connections":
            headers["connection"] = "close"
        if refusal.location is not None:
            headers["location"] = scope.get(PREFIX, "") + refusal.location
        answer = self.gateway.explain(refusal, scope, headers)
        start = {"status": answer.status_code, "headers": answer.raw_headers}
        await send({"type": f"{prefix}.start", **start})
        await send({"type": f"{prefix}.body", "body": answer.body})


def _limited(receive: Receive, most: int) -> Receive:
    """Break off a body after `most` bytes, because a header may state a wrong length."""
    total = 0

    async def receive_limited() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > most:
            return {"type": "http.disconnect"}
        return message

    return receive_limited


def _address(scope: Scope) -> str:
    return str((scope.get("client") or ("", 0))[0])


def _headers(scope: Scope) -> dict[str, str]:
    """Return a request's headers; the first of repeated headers counts, but cookies are joined."""
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
    if not path.startswith(_PARTS) or path.endswith("-worker.js"):
        headers |= {
            "content-security-policy": content_policy(scheme, host),
            "x-frame-options": "DENY",
            "referrer-policy": "no-referrer",
            "cross-origin-opener-policy": "same-origin",
            "permissions-policy": "camera=(), microphone=(), geolocation=()",
        }
    return headers


def content_policy(scheme: str, host: str, inline: Iterable[str] = ()) -> str:
    """Return the content policy of a document; `inline` are the hashes of its inline code."""
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
    """End a request or websocket whose slot was given to another client."""
    task = asyncio.current_task()
    if task is not None:
        task.uncancel()
    with contextlib.suppress(Exception):  # the connection may be closed already
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1013})
        else:
            await send({"type": "http.response.body", "body": b""})
