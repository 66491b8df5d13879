"""Streams as cameras write them: the page shows a picture or a true sentence, never nothing."""

from __future__ import annotations

import hashlib
import io
import re
from typing import Any
from unittest import mock
from urllib.parse import quote, urlsplit

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.mjpeg.answer import MAX_PART_BYTES, Answer, PictureFinder
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.mjpeg.line import CameraLine
from robot.clock import RealClock
from robot.errors import CameraError, ConfigurationError
from robot.testing import VirtualClock
from robot.types import Encoding
from tests.contract.real_parts import check_camera_on_its_real_line
from tests.kit.sizes import crossed
from tests.kit.wait import wait_until
from tests.standins.mjpeg import MjpegServer

SOURCE = "http://camera.local/stream?key=hush"


def encoded(ending: str, number: int, *, side: int = 24) -> bytes:
    pixels = np.random.default_rng(number).integers(0, 256, (side, side + 8, 3), dtype=np.uint8)
    return cv2.imencode(ending, pixels)[1].tobytes()


JPEGS = [encoded(".jpg", number, side=side) for number, side in enumerate((16, 40, 90, 200))]
PNGS = [encoded(".png", number) for number in range(3)]
THUMBNAIL = b"\xff\xe1" + (len(JPEGS[0]) + 2).to_bytes(2, "big") + JPEGS[0]
WITH_THUMBNAIL = JPEGS[2][:2] + THUMBNAIL + JPEGS[2][2:]
PROGRESSIVE = cv2.imencode(
    ".jpg", cv2.imdecode(np.frombuffer(JPEGS[2], np.uint8), 1), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
)[1].tobytes()
WHOLE = [*JPEGS, *PNGS, WITH_THUMBNAIL, PROGRESSIVE]


class FakeSocket(io.RawIOBase):
    """Delivers a camera's bytes piece by piece; the clock replaces the time between them."""

    def __init__(
        self, pieces: list[bytes], clock: VirtualClock, pause_s: float = 0.0, stalls: bool = False
    ) -> None:
        self._pieces, self._clock, self._pause_s, self._stalls = pieces, clock, pause_s, stalls
        self.asked = b""

    def sendall(self, data: bytes) -> None:
        self.asked += data

    def makefile(self, mode: str) -> io.BufferedReader:
        return io.BufferedReader(self)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._clock.advance(self._pause_s)
        if not self._pieces and self._stalls:
            raise TimeoutError("timed out")
        piece = self._pieces.pop(0) if self._pieces else b""
        if len(piece) > len(buffer):
            self._pieces.insert(0, piece[len(buffer) :])
            piece = piece[: len(buffer)]
        buffer[: len(piece)] = piece
        return len(piece)

    def setsockopt(self, *option: object) -> None: ...

    def shutdown(self, how: int) -> None: ...

    def close(self) -> None: ...


def watch(
    answers: list[list[bytes]], *, stalls: bool = False, source: str = SOURCE
) -> tuple[list[Any], str, list[bytes]]:
    """Run a camera over a server's answers to each request; return what it showed, reported and
    requested."""
    clock, shown = VirtualClock(), []
    sockets: list[FakeSocket] = []
    camera = MjpegCamera(MjpegOptions(source=source), clock)

    def connect(address: tuple[str, int], *_: object) -> FakeSocket:
        if not 0 < address[1] < 65536:
            raise OverflowError("port must be 0-65535")
        sockets.append(FakeSocket([*answers[len(sockets)]], clock, 0.01, stalls))
        return sockets[-1]

    camera.listen(lambda: shown.append(camera.latest()))
    said = ""
    try:
        with mock.patch("socket.create_connection", connect):
            camera._line.open()
        camera._read_out()
    except CameraError as error:
        said = str(error)
    return shown, said, [sock.asked for sock in sockets]


KINDS = ("", "image/jpeg", "application/octet-stream", 'Multipart/Mixed; boundary="other"')


def stream_of(
    pictures: list[bytes], status: str, kind: str, end: str, mark: str, fields: str, length: int
) -> bytes:
    """Return a camera's bytes; `mark` begins a part, and `length` is added to the true one."""
    chunked = "Transfer-Encoding: chunked" if fields == "chunked" else ""
    head = end.join(filter(None, [status, kind and f"Content-Type: {kind}", chunked, "Server: x"]))
    body = b""
    for picture in pictures:
        lines = [mark, "content-type:image/webp" if fields == "wrong" else "X-Timestamp: 0.1"]
        if fields != "none":
            lines.append(f"Content-Length: {len(picture) + length}")
        body += f"{end.join(lines)}{end}{end}".encode() + picture + end.encode()
    if chunked:
        pieces = [body[i : i + 700] for i in range(0, len(body), 700)]
        body = b"".join(f"{len(p):x}{end}".encode() + p + end.encode() for p in pieces)
    return f"{head}{end}{end}".encode() * bool(status) + body


@crossed(
    status=["HTTP/1.0 200 OK", "HTTP/1.1 200", "HTTP 200 OK", "ICY 200 OK", ""],
    kind=["multipart/x-mixed-replace;boundary=frame", *KINDS],
    end=["\r\n", "\n"],
    mark=["--frame", "----frame", "frame", "--=_x y_=", "--another"],
    fields=["usual", "chunked", "wrong", "none"],
    length=[0, -100, -1, 1, 5000],
    pictures=[JPEGS, PNGS, [WITH_THUMBNAIL, PROGRESSIVE, JPEGS[0]]],
    size=[7, 1460],
)
def test_the_pictures_of_any_stream_are_shown(
    status: str, kind: str, end: str, mark: str, fields: str, length: int, pictures: Any, size: int
) -> None:
    data = stream_of(pictures, status, kind, end, mark, fields if status else "none", length)
    shown, said, _ = watch([[data[i : i + size] for i in range(0, len(data), size)]])
    jpegs = [frame.data for frame in shown if frame.encoding is Encoding.JPEG]
    assert shown and set(jpegs) <= set(pictures), said
    last = cv2.imdecode(np.frombuffer(pictures[-1], np.uint8), 1)
    assert (shown[-1].height, shown[-1].width) == last.shape[:2]
    assert said and "hush" not in said


def test_each_picture_is_there_with_its_last_byte() -> None:
    finder = PictureFinder()
    for picture in [*WHOLE, *WHOLE]:
        assert finder.feed(b"\n--x\nContent-Length: 3\n\n" + picture[:-1]) == []
        assert finder.feed(picture[-1:]) == [picture]
        assert not finder.has_begun


def test_a_picture_that_was_cut_costs_no_other() -> None:
    finder = PictureFinder()
    cut_one = JPEGS[3][: len(JPEGS[3]) // 2]
    assert finder.feed(b"--x\r\n\r\n" + cut_one + b"\r\n--x\r\n\r\n" + JPEGS[1]) == [JPEGS[1]]
    in_its_tables = JPEGS[3][:100]
    assert finder.feed(in_its_tables + JPEGS[1] + JPEGS[2] + JPEGS[1])[-1] == JPEGS[1]


def read_whole(data: bytes, size: int = 1000) -> tuple[Answer, bytes]:
    pieces = [data[i : i + size] for i in range(0, len(data), size)]
    answer = Answer(FakeSocket(pieces, VirtualClock()))
    answer.begin()
    return answer, b"".join(iter(lambda: answer.read1(1000), b""))


@pytest.mark.parametrize("size", [1, 2, 5, 1000])
def test_chunks_are_read_however_they_are_split(size: int) -> None:
    head = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
    data = b"5\r\nhello\r\n1;x=y\r\n \nA\nwide world\r\n0\r\n\r\n"
    assert read_whole(head + data, size)[1] == b"hello wide world"
    assert read_whole(head + b"--frame\r\nplain")[1] == b"--frame\r\nplain"


def test_any_field_of_a_parts_header_may_be_missing() -> None:
    for text in (b"HTTP/1.1 206 x\r\nA: b\r\n\r\nbody", b"\r\nHTTP 206\nA: b\n\nbody"):
        answer, body = read_whole(text)
        assert answer.status == 206 and answer.headers["a"] == "b"
        assert body == b"body"


@pytest.mark.parametrize(
    "strange", ["junk", "Server : x", " folded", "Realm: K\u00fcche", ":", "HTTP/1.1 200 OK"]
)
def test_a_strange_line_of_a_header_does_not_affect_the_others(strange: str) -> None:
    fields = ["Transfer-Encoding : chunked", "content-type:image/jpeg"]
    for at, coding in ((0, "utf-8"), (1, "latin-1"), (2, "latin-1")):
        head = ["HTTP/1.1 200 OK", *fields[:at], strange, *fields[at:], "", ""]
        answer, body = read_whole("\r\n".join(head).encode(coding) + b"2\r\nab\r\n1\r\nc\r\n0\r\n")
        assert answer.headers["content-type"] == "image/jpeg" and body == b"abc"


def answer(status: str, *fields: str) -> list[bytes]:
    return ["\r\n".join([f"HTTP/1.1 {status}", *fields, "", ""]).encode()]


STREAM = [*answer("200 OK", "Content-Type: multipart/x-mixed-replace; boundary=x"), JPEGS[1]]
DIGEST = 'WWW-Authenticate: Digest realm="cam", nonce="abc", qop="auth,auth-int", algorithm=MD5'


USER = {"source": "http://me:secret@camera.local/stream?a=b"}


def test_a_redirect_is_followed_and_takes_no_password_elsewhere() -> None:
    shown, _, asked = watch([answer("302 Found", "Location: /new"), STREAM], **USER)
    assert shown and b"GET /new " in asked[1] and b"Authorization" in asked[1]
    elsewhere = answer("301 Moved", "Location: http://other.local:81/new")
    shown, _, asked = watch([elsewhere, STREAM], **USER)
    assert shown and b"Host: other.local:81" in asked[1] and b"Authorization" not in asked[1]


@pytest.mark.parametrize("letter", ["\u00fc", "\u00c5", "\u041c", "\u0105", "\u4e1c"])
def test_a_redirect_may_have_letters_of_any_language(letter: str) -> None:
    """In some encodings these bytes are line ends."""
    asked = watch([answer("302 Found", f"Location: /k{letter}che"), STREAM])[2]
    assert asked[1].startswith(f"GET /k{quote(letter)}che ".encode())


@pytest.mark.parametrize(
    "other", ["http://cam", "https://cam:444", "https://cam2", "http://cam:443"]
)
def test_the_password_is_sent_only_to_the_address_that_was_given(other: str) -> None:
    line = CameraLine(urlsplit("https://me:secret@Cam/stream"))
    for address, is_shown in ((other, False), ("https://cam:443", True)):
        assert line.shows_user(address + "/stream") is is_shown


@pytest.mark.parametrize(
    ("user", "asked", "hashed"),
    [
        ("me", ["MD5"], "md5"),
        ("me", ["md5"], "md5"),
        ("\u0436\u0443\u043a", ["MD5", "SHA-256"], "sha256"),
    ],
)
def test_the_digest_is_that_of_rfc_7616(user: str, asked: list[str], hashed: str) -> None:
    challenges = [DIGEST.replace("MD5", algorithm) for algorithm in asked]
    source = f"http://{user}:secret@camera.local/stream?a=b"
    shown, _, requests = watch([answer("401 No", *challenges), STREAM], source=source)
    assert shown and b"secret" not in b"".join(requests)
    header = requests[1].decode().partition("Authorization: Digest ")[2]
    given = dict(re.findall(r'(\w+)="?([^",]*)', header))
    assert (given["username"], given["realm"], given["uri"]) == (user, "cam", "/stream?a=b")

    def h(text: str) -> str:
        return hashlib.new(hashed, text.encode()).hexdigest()

    proof = [given["nonce"], given["nc"], given["cnonce"], "auth", h("GET:/stream?a=b")]
    assert given["response"] == h(":".join([h(f"{user}:cam:secret"), *proof]))


def moved(place: str) -> list[bytes]:
    return answer("302 Found", f"Location: {place}")


PLACES = ("ftp://a/b", "http://[", "http://a:99999999/")
STRANGE_DIGESTS = (
    DIGEST.replace("MD5", "SHA3-x"),
    DIGEST.replace("cam", "K\u00fcche"),
    DIGEST + ", opaque=",
    DIGEST.replace("nonce", "none"),
    "WWW-Authenticate: Digest x",
)
REASONS: list[tuple[str, list[list[bytes]], dict[str, Any]]] = [
    ("without an answer", [[]], {}),
    ("sends nothing", [STREAM[:1]], {"stalls": True}),
    ("closes the connection after one picture", [STREAM], {}),
    ("cut", [[*STREAM[:1], JPEGS[3][:9000] + b"\r\n--x\r\n\r\n" + JPEGS[1][:-9]]], {}),
    ("without any JPEG or PNG", [[*STREAM[:1], b"--x\r\n\r\n" + b"a picture?" * 20]], {}),
    ("a web page", [answer("200 OK", "Content-Type: text/html")], {}),
    ("image/webp", [[*STREAM[:1], b"Content-Type: image/webp\r\n\r\nRIFF" * 9]], {}),
    ("did not end", [[*STREAM[:1], JPEGS[1][:-9]]], {"stalls": True}),
    ("circle", [moved("/")] * 9, {}),
    *(("an invalid address", [moved(place)], {}) for place in PLACES),
    *((f"/stream answers {n}: ", [answer(f"{n} Found")], {}) for n in (300, 302, 304)),
    ("--source http://USER", [answer("401 No", DIGEST)], {}),
    ("does not accept this user", [answer("401 No", DIGEST)] * 2, USER),
    *(("unsupported kind", [answer("401 No", digest)], USER) for digest in STRANGE_DIGESTS),
]


@pytest.mark.parametrize(("words", "answers", "how"), REASONS, ids=[words for words, *_ in REASONS])
def test_the_reported_reason_of_a_failure_is_true(
    words: str, answers: list[list[bytes]], how: dict[str, Any]
) -> None:
    assert words in watch(answers, **how)[1]


@pytest.mark.parametrize(
    ("burst", "pause_s", "is_slow"),
    [(5, 0.4, False), (1, 0.04, False), (1, 1.0, False), (1, 2.0, True)],
)
def test_bursts_are_no_fault_and_a_slow_camera_is_called_slow(
    burst: int, pause_s: float, is_slow: bool
) -> None:
    clock = VirtualClock()
    camera = MjpegCamera(MjpegOptions(source=SOURCE), clock)
    faults = set()
    for number in range(40):
        camera._take(encoded(".jpg", number), clock.now_s())
        clock.advance(0.001)
        if number % burst == 0:
            for _ in range(int(pause_s / 0.05)):
                clock.advance(0.05)
                wrong = camera._freshness.fault(clock.now_s())
                if number > burst:
                    faults.add(camera._explain(wrong) if wrong else None)
    slow = {text for text in faults if text}
    assert bool(slow) is is_slow and all("a picture only every 2.0 s" in text for text in slow)


@given(st.binary(max_size=2000), st.integers(1, 50))
def test_random_bytes_do_not_crash_the_reader(data: bytes, size: int) -> None:
    rubbish = b"\xff\xd8\xff" + data + b"\xff\xd9"
    whole, finder = PictureFinder().feed(rubbish), PictureFinder()
    found = [p for i in range(0, len(rubbish), size) for p in finder.feed(rubbish[i : i + size])]
    assert found == whole


def test_a_picture_without_end_is_refused() -> None:
    finder = PictureFinder()
    finder.feed(b"--frame\r\n\r\n\xff\xd8\xff\xda\x00\x02")
    with pytest.raises(CameraError, match="4 MB"):
        finder.feed(bytes(MAX_PART_BYTES))


def camera_of(source: str) -> MjpegCamera:
    return MjpegCamera(MjpegOptions(source=source), RealClock())


@pytest.mark.parametrize(
    "source",
    ["", "0", "film.avi", "rtsp://a/b", "http://", "ftp://a", "http://a:99999/", "http://a..b/"],
)
def test_an_invalid_address_is_refused_at_once(source: str) -> None:
    with pytest.raises(ConfigurationError, match="--source"):
        camera_of(source)


@pytest.mark.realtime
def test_a_stream_is_read_over_a_real_connection() -> None:
    check_camera_on_its_real_line("mjpeg")
    what_is_no_stream_is_said()
    for with_length in (True, False):
        a_lost_stream_is_a_fault_and_comes_back(with_length)


def what_is_no_stream_is_said() -> None:
    with MjpegServer() as server:
        with pytest.raises(CameraError, match="text/html"):
            camera_of(server.address.replace("/stream", "/")).start()
        server.refuses = True
        with pytest.raises(CameraError, match="404"):
            camera_of(server.address).start()
    with pytest.raises(CameraError, match="does not answer"):
        camera_of(server.address).start()


def a_lost_stream_is_a_fault_and_comes_back(with_length: bool) -> None:
    with (
        MjpegServer(with_length=with_length) as server,
        camera_of(server.address.replace("//", "//me:p%20w@")) as running,
    ):
        wait_until(running.latest)
        assert server.asked[0] == "Basic bWU6cCB3"
        server.refuses = True
        wait_until(lambda: "gives no pictures" in (running.fault or ""))
        server.refuses = False
        wait_until(lambda: running.fault is None)
