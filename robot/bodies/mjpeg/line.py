"""The connection to a camera: asks for its stream, follows it to where it is, shows who asks."""

from __future__ import annotations

import contextlib
import socket
import ssl
from urllib.parse import SplitResult, unquote, urljoin, urlsplit

from robot.bodies.mjpeg.answer import Chunks, Head, basic, digest, read_head
from robot.errors import CameraError

_SILENT_S = 2.0
_MOST_REQUESTS = 6
_MOVED = (301, 302, 303, 307, 308)


class CameraLine:
    """One connection at a time; `close` may be called from any thread, and wakes who reads."""

    def __init__(self, url: SplitResult) -> None:
        self._url = url
        self._socket: socket.socket | None = None
        self._body = b""
        self._chunks: Chunks | None = None

    def open(self) -> None:
        """Ask for the stream.

        User and password are sent to the address that was given, and to no other.

        Raises:
            CameraError: If there is no stream; says what the camera answered, and what to do.
        """
        try:
            self._open()
        except CameraError:
            self.close()
            raise

    def _open(self) -> None:
        url, has_answered = self._url, False
        user, password = unquote(url.username or ""), unquote(url.password or "")
        shown = basic(user, password) if user else None
        for _ in range(_MOST_REQUESTS):
            where = f"the camera at {url.hostname}"
            head = self._ask(url, shown, where)
            place = head.first("location")
            if head.status in _MOVED and place:
                url, has_answered = _moved(url, place, where), False
                is_home = _origin(url) == _origin(self._url)
                shown = basic(user, password) if user and is_home else None
            elif head.status == 401:
                address = url._replace(netloc=_netloc(url)).geturl()
                is_first = shown and not has_answered
                try:
                    answer = digest(head, address, user, password) if is_first else None
                except ValueError as error:
                    raise CameraError(
                        f"{where} asks for a password in a way that is not known here ({error}); "
                        "choose Basic, or Digest with MD5 or SHA-256, in its settings"
                    ) from error
                if answer is None:
                    raise CameraError(f"{where} answers 401: {_ask_for_password(user, shown)}")
                shown, has_answered = answer, True
            elif head.complaint:
                raise CameraError(f"{url.hostname}{url.path or '/'} {head.complaint}")
            else:
                return
        raise CameraError(f"{where} sends us in a circle; look up the address of its stream")

    def read1(self, size: int) -> bytes:
        """Return some bytes of the stream; none at its end. Raises OSError after 2 s of silence."""
        while True:
            data, self._body = self._body, b""
            sock = self._socket
            data = data or (sock.recv(size) if sock else b"")
            if not data:
                return b""
            body = data if self._chunks is None else self._chunks.feed(data)
            if body:
                return body

    def close(self) -> None:
        """End the connection: a camera of one client serves nobody else until then."""
        sock, self._socket = self._socket, None
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _ask(self, url: SplitResult, shown: str | None, where: str) -> Head:
        self.close()
        try:
            self._connect(url)
            self._send(url, shown)
            head, self._body = self._read_head()
        except (OSError, ValueError) as error:
            self.close()
            raise CameraError(
                f"{where} does not answer ({error}); is it switched on and in the same network, "
                "and is the port right?"
            ) from error
        is_chunked = "chunked" in head.first("transfer-encoding").lower()
        self._chunks = Chunks() if is_chunked else None
        return head

    def _connect(self, url: SplitResult) -> None:
        is_secure = url.scheme == "https"
        port = url.port or (443 if is_secure else 80)
        self._socket = socket.create_connection((url.hostname, port), timeout=_SILENT_S)
        if is_secure:
            context = ssl.create_default_context()
            self._socket = context.wrap_socket(self._socket, server_hostname=url.hostname)

    def _send(self, url: SplitResult, shown: str | None) -> None:
        path = (url.path or "/") + (f"?{url.query}" if url.query else "")
        path = path.replace(" ", "%20")
        lines = [f"GET {path} HTTP/1.1", f"Host: {_netloc(url)}", "User-Agent: drivelesson"]
        lines += ["Accept: */*", "Connection: close"]
        lines += [f"Authorization: {shown}"] if shown else []
        sock = self._socket
        if sock is None:
            raise ConnectionError("the connection was closed")
        sock.sendall("\r\n".join([*lines, "", ""]).encode())

    def _read_head(self) -> tuple[Head, bytes]:
        """Read until the head is there, or all that there is; raises OSError for nothing."""
        data = b""
        while (found := read_head(data)) is None:
            try:
                more = self._socket.recv(65_536) if self._socket else b""
            except TimeoutError:
                if not data:
                    raise
                more = b""
            if not more:
                if not data.strip():
                    raise ConnectionError("it hung up without a word")
                more = b"\r\n\r\n"
            data += more
        head, begin = found
        return head, data[begin:]


def _moved(url: SplitResult, place: str, where: str) -> SplitResult:
    try:
        moved = urlsplit(urljoin(url._replace(netloc=_netloc(url)).geturl(), place))
        if moved.scheme in ("http", "https") and moved.hostname and moved.port != 0:
            return moved
    except ValueError:
        pass
    raise CameraError(f"{where} sends us to an address that is none; look up that of its stream")


def _netloc(url: SplitResult) -> str:
    return url.netloc.rpartition("@")[2]


def _origin(url: SplitResult) -> tuple[str, str | None, int | None]:
    return url.scheme, url.hostname, url.port


def _ask_for_password(user: str, shown: str | None) -> str:
    if user and shown:
        return "it does not take this user and password; look them up in its settings"
    return "it wants a user and a password, as in --source http://USER:PASSWORD@ADDRESS/PATH"
