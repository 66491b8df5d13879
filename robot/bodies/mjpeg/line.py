"""The connection to a camera: asks for its stream, follows it to where it is, shows who asks."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import socket
import string
from collections.abc import Callable
from email.message import Message
from http.client import HTTPConnection, HTTPException, HTTPMessage
from typing import Any
from urllib import request as http
from urllib.error import HTTPError, URLError
from urllib.parse import SplitResult, quote, unquote, urlsplit

from robot.bodies.mjpeg.answer import Answer
from robot.errors import CameraError

_SILENT_S = 2.0
_PORTS = {"http": 80, "https": 443}
_MOVED = (301, 302, 303, 307, 308)
_PAGES = ("text/", "application/json", "application/xml", "application/xhtml")
_ADVICE = {
    403: "it lets nobody in from here; look into its settings",
    404: "there is nothing at this path; look up the address of the stream in its manual",
    503: "it is busy; end its other viewers, or restart it",
}


class CameraLine:
    """One connection at a time; `close` may be called from any thread, and wakes who reads.

    Raises:
        ValueError: If `url` is no address of a camera.
    """

    def __init__(self, url: SplitResult) -> None:
        self._address = quote(_checked(url), safe=string.punctuation)
        self.host, self._has_user = url.hostname, bool(url.username)
        self._socket: socket.socket | None = None
        self._answer: Any = None
        self._opener = http.OpenerDirector()
        self._opener.addheaders = [("User-Agent", "drivelesson"), ("Accept", "*/*")]
        for handler in (
            _Lines(self._begin),
            _Passwords(url),
            _Redirects(),
            http.HTTPErrorProcessor(),
            http.HTTPDefaultErrorHandler(),
        ):
            self._opener.add_handler(handler)

    def open(self) -> None:
        """Ask for the stream.

        User and password are sent to the address that was given, and to no other.

        Raises:
            CameraError: If there is no stream; says what the camera answered, and what to do.
        """
        try:
            self._answer = self._opener.open(self._address, timeout=_SILENT_S)
            kind = _kind(self._answer.headers)
            if kind.startswith(_PAGES):
                raise CameraError(
                    f"{_place(self._answer.url)} answers 200 {kind}: that is a page; give the "
                    "address of the stream itself, as its manual names it"
                )
        except CameraError:
            self.close()
            raise
        except (OSError, HTTPException, ValueError) as error:
            self.close()
            raise CameraError(self._explain(error)) from error

    def read1(self, size: int) -> bytes:
        """Return some bytes of the stream; none at its end. Raises OSError after 2 s of silence."""
        answer = self._answer
        data: bytes = b"" if answer is None else answer.read1(size)
        return data

    def close(self) -> None:
        """End the connection: a camera of one client serves nobody else until then."""
        sock, self._socket, self._answer = self._socket, None, None
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _begin(self, sock: socket.socket, *args: Any, **options: Any) -> Answer:
        self._socket = sock
        return Answer(sock, *args, **options)

    def _explain(self, error: Exception) -> str:
        where = f"the camera at {self.host}"
        if isinstance(error, HTTPError) and error.code == 401:
            advice = (
                "it wants a user and a password, as in --source http://USER:PASSWORD@ADDRESS/PATH"
            )
            if self._has_user:
                advice = "it does not take this user and password; look them up in its settings"
            return f"{where} answers 401: {advice}"
        if isinstance(error, HTTPError) and not _is_moved(error):
            said = f"{error.code} {_kind(error.headers)}".rstrip()
            advice = "restart it, or look up the address in its manual"
            return f"{_place(error.url)} answers {said}: {_ADVICE.get(error.code, advice)}"
        if isinstance(error, HTTPError | ValueError):
            return (
                f"{where} leads in a circle, or to an address that is none; look up that of its "
                "stream"
            )
        return (
            f"{where} does not answer ({getattr(error, 'reason', error)}); is it switched on and "
            "in the same network, and is the port right?"
        )


class _Lines(http.HTTPHandler, http.HTTPSHandler):
    """Opens connections whose answers are `begin`'s."""

    def __init__(self, begin: Callable[..., Answer]) -> None:
        super().__init__()
        self._begin = begin

    def do_open(self, http_class: Any, req: http.Request, **options: Any) -> Any:
        def make(host: str, **options: Any) -> HTTPConnection:
            connection: HTTPConnection = http_class(host, **options)
            connection.response_class = self._begin  # type: ignore[assignment]
            return connection

        return super().do_open(make, req, **options)


class _Redirects(http.HTTPRedirectHandler):
    """Follows to where a camera may be; ValueError for every other address."""

    def redirect_request(
        self, req: http.Request, fp: Any, code: int, msg: str, headers: Any, newurl: str
    ) -> http.Request | None:
        newurl = _checked(urlsplit(newurl))
        return super().redirect_request(req, fp, code, msg, headers, newurl)


class _OneAddress(http.HTTPPasswordMgr):
    """Knows user and password of one address; the library's would show them on other schemes."""

    def __init__(self, url: SplitResult) -> None:
        super().__init__()
        self._home = _origin(url)
        self._known = unquote(url.username or ""), unquote(url.password or "")

    def find_user_password(self, realm: str, authuri: str) -> tuple[str, str] | tuple[None, None]:
        return self._known if _origin(urlsplit(authuri)) == self._home else (None, None)


class _Passwords(http.HTTPDigestAuthHandler):
    """Shows user and password where they belong: as Basic at once, as a digest if that is asked.

    Knows SHA-256, too; before Python 3.14 the library's does not.
    """

    def __init__(self, url: SplitResult) -> None:
        self._known = _OneAddress(url)
        super().__init__(self._known)

    def http_request(self, req: http.Request) -> http.Request:
        user, password = self._known.find_user_password("", req.full_url)
        if user and not req.has_header("Authorization"):
            shown = base64.b64encode(f"{user}:{password}".encode()).decode()
            req.add_unredirected_header("Authorization", f"Basic {shown}")
        return req

    https_request = http_request

    def http_error_401(
        self, req: http.Request, fp: Any, code: int, msg: str, headers: HTTPMessage
    ) -> Any:
        asked = [text for text in headers.get_all("www-authenticate", []) if _asks_digest(text)]
        if not asked or not req.get_header("Authorization", "").startswith("Basic "):
            return None
        fp.close()
        # A camera that knows several asks for the safest first, but need not.
        text = max(asked, key=lambda text: "sha-256" in text.lower())
        parts = http.parse_http_list(text.partition(" ")[2])
        try:
            words = self.get_authorization(req, http.parse_keqv_list([p for p in parts if p]))
        except (ValueError, LookupError, URLError):
            words = None
        if words is None:
            raise CameraError(
                f"the camera at {req.host} asks for a password in a way that is not known here; "
                "choose Basic, or Digest with MD5 or SHA-256, in its settings"
            )
        req.add_unredirected_header("Authorization", f"Digest {words}")
        return self.parent.open(req, timeout=req.timeout)

    def get_algorithm_impls(
        self, algorithm: str
    ) -> tuple[Callable[[str], str], Callable[[str, str], str]]:
        if algorithm.upper() != "SHA-256":
            return super().get_algorithm_impls(algorithm.upper())
        return _sha256, lambda secret, data: _sha256(f"{secret}:{data}")


def _asks_digest(challenge: str) -> bool:
    return challenge[:7].lower() == "digest "


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _kind(headers: Message) -> str:
    return str(headers.get("content-type", "")).partition(";")[0].strip().lower()


def _place(address: str) -> str:
    url = urlsplit(address)
    return f"{url.hostname}{url.path or '/'}"


def _is_moved(error: HTTPError) -> bool:
    return error.code in _MOVED and "location" in error.headers


def _origin(url: SplitResult) -> tuple[str, str | None, int]:
    return url.scheme, url.hostname, url.port or _PORTS.get(url.scheme, 0)


def _checked(url: SplitResult) -> str:
    """Return an address as it is asked for, without user; ValueError if there can be no camera."""
    host = url.netloc.rpartition("@")[2].encode("idna").decode()
    if url.scheme not in _PORTS or not url.hostname or url.port == 0:
        raise ValueError("no address of a camera")
    return url._replace(netloc=host).geturl()
