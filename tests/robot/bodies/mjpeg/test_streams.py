"""Whatever stream a camera sends, the page shows its pictures or a true sentence."""

from __future__ import annotations

import hashlib
import io
import re
from functools import partial
from typing import Any
from unittest import mock
from urllib.parse import urlsplit

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
from tests.contract.real_parts import check_real_camera
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


class FakeSocket(io.RawIOBase):
    """Delivers a camera's bytes piece by piece; the clock replaces the time between them."""

    def __init__(self, data: bytes, size: int, clock: VirtualClock, stalls: bool = False) -> None:
        self._pieces = [data[at : at + size] for at in range(0, len(data), size)]
        self._clock, self._stalls = clock, stalls
        self.asked = b""

    def sendall(self, data: bytes) -> None:
        self.asked += data

    def makefile(self, mode: str) -> io.BufferedReader:
        return io.BufferedReader(self)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._clock.advance(0.01)
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
    *answers: bytes, stalls: bool = False, source: str = SOURCE, size: int = 1460
) -> tuple[list[Any], str, list[bytes]]:
    """Run a camera with a server's answers to its requests; return its pictures, reports and
    requests."""
    clock, shown = VirtualClock(), []
    sockets: list[FakeSocket] = []
    camera = MjpegCamera(MjpegOptions(source=source), clock)

    def connect(address: tuple[str, int], *_: object) -> FakeSocket:
        if not 0 < address[1] < 65536:
            raise OverflowError("port must be 0-65535")
        sockets.append(FakeSocket(answers[len(sockets)], size, clock, stalls))
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
    kind=["multipart/x-mixed-replace;boundary=frame", "", "image/jpeg", 'Mixed; boundary="other"'],
    end=["\r\n", "\n"],
    mark=["--frame", "frame", "--=_x y_="],
    fields=["usual", "chunked", "wrong", "none"],
    length=[0, -100, 1, 5000],
    pictures=[JPEGS, PNGS, [WITH_THUMBNAIL, PROGRESSIVE, JPEGS[0]]],
    size=[7, 1460],
)
def test_the_pictures_of_any_stream_are_shown(
    status: str, kind: str, end: str, mark: str, fields: str, length: int, pictures: Any, size: int
) -> None:
    data = stream_of(pictures, status, kind, end, mark, fields if status else "none", length)
    shown, said, _ = watch(data, size=size)
    jpegs = [frame.data for frame in shown if frame.encoding is Encoding.JPEG]
    assert shown and set(jpegs) <= set(pictures), said
    last = cv2.imdecode(np.frombuffer(pictures[-1], np.uint8), 1)
    assert (shown[-1].height, shown[-1].width) == last.shape[:2]
    assert said and "hush" not in said


def test_each_picture_is_shown_as_soon_as_its_last_byte_has_arrived() -> None:
    finder = PictureFinder()
    for picture in 2 * [*JPEGS, *PNGS, WITH_THUMBNAIL, PROGRESSIVE]:
        assert finder.feed(b"\n--x\nContent-Length: 3\n\n" + picture[:-1]) == []
        assert finder.feed(picture[-1:]) == [picture]
        assert not finder.has_begun


def test_a_truncated_picture_costs_no_other_picture() -> None:
    finder = PictureFinder()
    cut_one = JPEGS[3][: len(JPEGS[3]) // 2]
    assert finder.feed(b"--x\r\n\r\n" + cut_one + b"\r\n--x\r\n\r\n" + JPEGS[1]) == [JPEGS[1]]
    in_its_tables = JPEGS[3][:100]
    assert finder.feed(in_its_tables + JPEGS[1] + JPEGS[2] + JPEGS[1])[-1] == JPEGS[1]


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


CHUNKED = b"HTTP/1.1 200 OK\r\nTransfer-Encoding : chunked\r\ncontent-type:image/jpeg\r\n"
STRANGE = b"junk\r\n folded\r\nRealm: K\xfcche\r\n:\r\n\r\n"
CHUNKS = b"5\r\nhello\r\n1;x=y\r\n \nA\nwide world\r\n0\r\n\r\n"


@pytest.mark.parametrize(
    ("data", "status", "body"),
    [
        (CHUNKED + b"\r\n" + CHUNKS, 200, b"hello wide world"),
        (CHUNKED + b"\r\n--frame\r\nplain", 200, b"--frame\r\nplain"),
        (CHUNKED + STRANGE + CHUNKS, 200, b"hello wide world"),
        (b"\r\nHTTP 206\nContent-Type: image/jpeg\n\nbody", 206, b"body"),
    ],
    ids=["chunks", "no chunks in spite of the head", "strange lines", "a short head"],
)
def test_any_head_and_chunks_are_read_however_they_are_split(
    data: bytes, status: int, body: bytes
) -> None:
    for size in (1, 5, 1000):
        answer = Answer(FakeSocket(data, size, VirtualClock()))
        answer.begin()
        assert (answer.status, answer.headers["content-type"]) == (status, "image/jpeg")
        assert b"".join(iter(partial(answer.read1, 1000), b"")) == body


def answer(status: str, *fields: str) -> bytes:
    return "\r\n".join([f"HTTP/1.1 {status}", *fields, "", ""]).encode()


HEAD = answer("200 OK", "Content-Type: multipart/x-mixed-replace; boundary=x")
STREAM = HEAD + JPEGS[1]
DIGEST = 'WWW-Authenticate: Digest realm="cam", nonce="abc", qop="auth,auth-int", algorithm=MD5'
USER = {"source": "http://me:secret@camera.local/stream?a=b"}


def moved(place: str) -> bytes:
    return answer("302 Found", f"Location: {place}")


@pytest.mark.parametrize(
    ("place", "asks", "is_home"),
    [
        ("/new", b"GET /new ", True),
        ("http://CAMERA.local:80/new", b"GET /new ", True),
        ("/k\u0105che", b"GET /k%C4%85che ", True),  # one byte of ā is a line end in Latin-1
        ("http://other.local:81/new", b"Host: other.local:81", False),
    ],
)
def test_a_redirect_is_followed_and_takes_no_password_elsewhere(
    place: str, asks: bytes, is_home: bool
) -> None:
    shown, _, asked = watch(moved(place), STREAM, **USER)
    assert shown and asks in asked[1] and (b"Authorization" in asked[1]) is is_home


@pytest.mark.parametrize(
    "other", ["http://cam", "https://cam:444", "https://cam2", "http://cam:443"]
)
def test_the_password_is_sent_only_to_the_address_that_was_given(other: str) -> None:
    line = CameraLine(urlsplit("https://me:secret@Cam/stream"))
    for address, is_shown in ((other, False), ("https://cam:443", True)):
        assert line.shows_user(address + "/stream") is is_shown


@pytest.mark.parametrize(
    ("user", "algorithms", "hashed"),
    [("me", ["md5"], "md5"), ("\u0436\u0443\u043a", ["MD5", "SHA-256"], "sha256")],
)
def test_the_digest_is_that_of_rfc_7616(user: str, algorithms: list[str], hashed: str) -> None:
    challenges = [DIGEST.replace("MD5", algorithm) for algorithm in algorithms]
    source = f"http://{user}:secret@camera.local/stream?a=b"
    shown, _, requests = watch(answer("401 No", *challenges), STREAM, source=source)
    assert shown and b"secret" not in b"".join(requests)
    header = requests[1].decode().partition("Authorization: Digest ")[2]
    given = dict(re.findall(r'(\w+)="?([^",]*)', header))
    assert (given["username"], given["realm"], given["uri"]) == (user, "cam", "/stream?a=b")

    def h(text: str) -> str:
        return hashlib.new(hashed, text.encode()).hexdigest()

    proof = [given["nonce"], given["nc"], given["cnonce"], "auth", h("GET:/stream?a=b")]
    assert given["response"] == h(":".join([h(f"{user}:cam:secret"), *proof]))


REASONS: list[tuple[str, list[bytes], dict[str, Any]]] = [
    ("without an answer", [b""], {}),
    ("sends nothing", [HEAD], {"stalls": True}),
    ("closes the connection after one picture", [STREAM], {}),
    ("cut", [HEAD + JPEGS[3][:9000] + b"\r\n--x\r\n\r\n" + JPEGS[1][:-9]], {}),
    ("image/webp", [HEAD + b"Content-Type: image/webp\r\n\r\nRIFF" * 9], {}),
    ("did not end", [STREAM[:-9]], {"stalls": True}),
    ("a web page", [answer("200 OK", "Content-Type: text/html")], {}),
    ("endlessly", [moved("/")] * 9, {}),
    *(("an invalid address", [moved(at)], {}) for at in ("ftp://a/b", "http://a:99999999/")),
    ("/stream answers 404: there is nothing", [answer("404 No")], {}),
    ("/stream answers 304: restart it", [answer("304 Found")], {}),
    ("--source http://USER", [answer("401 No", DIGEST)], {}),
    ("does not accept this user", [answer("401 No", DIGEST)] * 2, USER),
    *(
        ("unsupported authentication", [answer("401 No", digest)], USER)
        for digest in (
            DIGEST.replace("MD5", "SHA3-x"),
            DIGEST.replace("cam", "K\u00fcche"),
            DIGEST + ", opaque=",
            DIGEST.replace("nonce", "none"),
        )
    ),
]


@pytest.mark.parametrize(("words", "answers", "how"), REASONS, ids=[words for words, *_ in REASONS])
def test_the_reported_reason_of_a_failure_is_true(
    words: str, answers: list[bytes], how: dict[str, Any]
) -> None:
    assert words in watch(*answers, **how)[1]


@pytest.mark.parametrize(
    ("burst", "pause_s", "is_slow"), [(5, 0.4, False), (1, 1.0, False), (1, 2.0, True)]
)
def test_bursts_are_not_a_fault_and_a_slow_camera_is_reported_as_slow(
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


@pytest.mark.parametrize(
    "source", ["", "film.avi", "http://", "ftp://a", "http://a:99999/", "http://a..b/"]
)
def test_an_invalid_address_is_refused_at_once(source: str) -> None:
    with pytest.raises(ConfigurationError, match="--source"):
        MjpegCamera(MjpegOptions(source=source), VirtualClock())


@pytest.mark.realtime
def test_a_stream_is_read_over_a_real_connection_and_again_after_it_was_lost() -> None:
    with MjpegServer() as server:
        check_real_camera(MjpegCamera(MjpegOptions(source=server.address), RealClock()))
    with MjpegServer(with_length=False) as server:
        options = MjpegOptions(source=server.address.replace("//", "//me:p%20w@"))
        with MjpegCamera(options, RealClock()) as camera:
            wait_until(camera.latest)
            assert server.asked[0] == "Basic bWU6cCB3"
            server.refuses = True
            wait_until(lambda: "gives no pictures" in (camera.fault or ""))
            server.refuses = False
            wait_until(lambda: camera.fault is None)
    with pytest.raises(CameraError, match="does not answer"):
        MjpegCamera(options, RealClock()).start()
