"""The HTTP connection to a camera: requests the stream, follows redirects, authenticates."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import socket
import string
from collections.abc import Callable
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from typing import Any, cast
from urllib import request as http
from urllib.error import URLError
from urllib.parse import SplitResult, quote, unquote, urljoin, urlsplit

from robot.bodies.mjpeg.answer import Answer
from robot.errors import CameraError

_SILENT_S = 2.0
_MOST_REQUESTS = 8
_HEAD = {"User-Agent": "drivelesson", "Accept": "*/*", "Connection": "close"}
_LINES = {"http": HTTPConnection, "https": HTTPSConnection}
_MOVED = (301, 302, 303, 307, 308)
_PAGES = ("text/", "application/json", "application/xml", "application/xhtml")
_ADVICE = {
    401: "it needs a user and a password, as in --source http://USER:PASSWORD@ADDRESS/PATH",
    403: "it refuses connections from this computer; check its settings",
    404: "there is nothing at this path; look up the address of the stream in its manual",
    503: "it is busy; close its other viewers, or restart it",
}


class CameraLine:
    """The connection to a camera. `close` may be called on any thread, and ends a waiting `read1`.
    The constructor raises ValueError if `url` cannot be a camera's address."""

    def __init__(self, url: SplitResult) -> None:
        self._address = quote(_checked(url), safe=string.punctuation)
        self.host, self._home = url.hostname, _origin(url)
        self._user, self._password = unquote(url.username or ""), unquote(url.password or "")
        self._socket: socket.socket | None = None
        self._answer: Answer | None = None

    def open(self) -> None:
        """Request the stream.

        User and password are sent only to the configured address.

        Raises:
            CameraError: If there is no stream; the error contains the camera's answer and advice.
        """
        try:
            self._answer = self._follow()
        except (OSError, HTTPException, ValueError) as error:
            self.close()
            if isinstance(error, CameraError):
                raise
            why = (
                "redirects endlessly, or to an invalid address; look up the address of its stream"
                if isinstance(error, ValueError)
                else f"does not answer ({error}); is it switched on and in the same network, and "
                "is the port right?"
            )
            raise CameraError(f"the camera at {self.host} {why}") from error

    def read1(self, size: int) -> bytes:
        """Return some bytes of the stream; empty at its end.

        Raises OSError after 2 s of silence.
        """
        answer = self._answer
        return b"" if answer is None else answer.read1(size)

    def close(self) -> None:
        """Close the connection, because some cameras serve only one client."""
        sock, self._socket, self._answer = self._socket, None, None
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def shows_user(self, address: str) -> bool:
        """True if user and password may be sent: only to the same host, port and scheme."""
        return bool(self._user) and _origin(urlsplit(address)) == self._home

    def _follow(self) -> Answer:
        """Request the stream, follow redirects, and use Basic or Digest authentication if the
        camera requires it."""
        address, challenges = self._address, list[str]()
        for _ in range(_MOST_REQUESTS):
            asked, is_home = http.Request(address, headers=_HEAD), self.shows_user(address)
            if is_home:
                asked.add_header("Authorization", self._shown(asked, challenges))
            answer = self._ask(asked)
            place = answer.headers.get("location")
            if place and answer.status in _MOVED:
                place = quote(place, safe=string.punctuation, encoding="latin-1")
                address, challenges = _checked(urlsplit(urljoin(address, place))), []
            elif is_home and not challenges and (found := _digests(answer)):
                challenges = found
            else:
                self._check(asked, answer)
                return answer
        raise ValueError("in a circle")

    def _ask(self, asked: http.Request) -> Answer:
        self.close()
        connection = _LINES[asked.type](asked.host, timeout=_SILENT_S)
        connection.response_class = self._begin
        connection.request("GET", asked.selector, headers=asked.headers)
        return cast(Answer, connection.getresponse())

    def _begin(self, sock: socket.socket, *args: Any, **options: Any) -> Answer:
        self._socket = sock
        return Answer(sock, *args, **options)

    def _check(self, asked: http.Request, answer: Answer) -> None:
        """Raise CameraError if the camera's response cannot be a stream."""
        url, kind = urlsplit(asked.full_url), answer.headers.get("content-type", "")
        kind = kind.partition(";")[0].strip().lower()
        if answer.status // 100 != 2:
            advice = _ADVICE.get(answer.status, "restart it, or look up the address in its manual")
            if answer.status == 401 and self._user:
                advice = "it does not accept this user and password; look them up in its settings"
        elif kind.startswith(_PAGES):
            advice = (
                "this is the address of a web page; give the address of the stream, as in the "
                "camera's manual"
            )
        else:
            return
        said = f"{answer.status} {kind}".rstrip()
        raise CameraError(f"{url.hostname}{url.path or '/'} answers {said}: {advice}")

    def _shown(self, asked: http.Request, challenges: list[str]) -> str:
        """Return the value of the HTTP header `Authorization`. It answers the strongest of the
        camera's challenges. If there is no challenge, Basic authentication is used."""
        if not challenges:
            return f"Basic {base64.b64encode(f'{self._user}:{self._password}'.encode()).decode()}"
        passwords = http.HTTPPasswordMgrWithDefaultRealm()
        passwords.add_password(None, asked.full_url, self._user, self._password)
        text = max(challenges, key=lambda text: "sha-256" in text.lower())
        parts = http.parse_http_list(text.partition(" ")[2])
        words = None
        with contextlib.suppress(ValueError, LookupError, URLError):
            challenge = http.parse_keqv_list([part for part in parts if part])
            words = _Digest(passwords).get_authorization(asked, challenge)
        if words is None:
            raise CameraError(
                f"the camera at {asked.host} uses an unsupported authentication; choose Basic, or "
                "Digest with MD5 or SHA-256, in its settings"
            )
        # http.client encodes headers as Latin-1, but the bytes must be UTF-8
        return f"Digest {words}".encode().decode("latin-1")


class _Digest(http.AbstractDigestAuthHandler):
    """Digest authentication with SHA-256. Python's standard library has it only from 3.14 on."""

    def get_algorithm_impls(
        self, algorithm: str
    ) -> tuple[Callable[[str], str], Callable[[str, str], str]]:
        if algorithm.upper() != "SHA-256":
            return super().get_algorithm_impls(algorithm.upper())
        return _sha256, lambda secret, data: _sha256(f"{secret}:{data}")


def _digests(answer: Answer) -> list[str]:
    """Return the challenges for Digest authentication in a response's headers."""
    asked = answer.headers.get_all("www-authenticate", []) if answer.status == 401 else []
    return [text for text in asked if text[:7].lower() == "digest "]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _origin(url: SplitResult) -> tuple[str, str | None, int]:
    return url.scheme, url.hostname, url.port or {"http": 80, "https": 443}.get(url.scheme, 0)


def _checked(url: SplitResult) -> str:
    """Return an address without user and password. Raises ValueError if it cannot be the address
    of a camera."""
    host = url.netloc.rpartition("@")[2].encode("idna").decode()
    if url.scheme not in _LINES or not url.hostname or url.port == 0:
        raise ValueError("not the address of a camera")
    return url._replace(netloc=host).geturl()
