"""Streams as cameras write them: the page shows a picture or a true sentence, never nothing."""

from __future__ import annotations

import hashlib
import io
import random
import re
from collections.abc import Callable
from typing import Any
from unittest import mock
from urllib.parse import quote, urlsplit

import cv2
import numpy as np
import pytest

from robot.bodies.mjpeg.answer import Answer, PictureFinder
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.mjpeg.line import CameraLine
from robot.errors import CameraError
from robot.testing import VirtualClock
from robot.types import Encoding
from tests.kit.sizes import size

STREAMS = size("STREAMS", 20, 1_000)
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
        self, pieces: list[bytes], clock: VirtualClock, pause_s: float = 0.0, *, stalls: bool
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


def cut(data: bytes, dice: random.Random) -> list[bytes]:
    pieces, at = [], 0
    most = dice.choice([1, 7, 100, 1460, 65_536]) if len(data) < 30_000 else 1460
    while at < len(data):
        size = dice.randint(1, most)
        pieces.append(data[at : at + size])
        at += size
    return pieces


def watch(answers: list[list[bytes]], *, pause_s: float = 0.01, stalls: bool = False,
          source: str = SOURCE) -> tuple[list[Any], str, list[bytes]]:  # fmt: skip
    """Run a camera over a server's answers to each request; return what it showed, reported and
    requested."""
    clock, shown = VirtualClock(), []
    sockets: list[FakeSocket] = []
    camera = MjpegCamera(MjpegOptions(source=source), clock)

    def connect(address: tuple[str, int], *_: object) -> FakeSocket:
        if not 0 < address[1] < 65536:
            raise OverflowError("port must be 0-65535")
        sockets.append(FakeSocket(answers[len(sockets)], clock, pause_s, stalls=stalls))
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


def made_stream(dice: random.Random) -> tuple[bytes, list[bytes], str, bool]:
    """Return a camera's bytes, its whole pictures, the expected words, and whether it stalls."""
    end = dice.choice([b"\r\n", b"\n"])
    what = dice.choice(["whole"] * 5 + ["cut", "other", "none", "status", "page"])
    boundary = dice.choice(
        [b"frame", b"--frame", b"=_x y_=", b"ipcamera", b"myboundary", b"x" * 70]
    )
    kinds = [b"multipart/x-mixed-replace;boundary=" + boundary, b"multipart/x-mixed-replace", b""]
    kinds += [b'Multipart/Mixed; boundary="other"', b"image/jpeg", b"application/octet-stream"]
    kind = dice.choice(kinds)
    status = dice.choice([b"HTTP/1.0 200 OK", b"HTTP/1.1 200", b"HTTP 200 OK", b"ICY 200 OK", b""])
    if what == "status":
        status = dice.choice([b"HTTP/1.1 404 Not Found", b"HTTP/1.0 503 Busy", b"HTTP 403 No"])
    if what == "page":
        status, kind = b"HTTP/1.1 200 OK", b"text/html; charset=utf-8"
    is_chunked = bool(status) and dice.random() < 0.3
    head = [status] if status else []
    head += [b"Content-Type: " + kind] if kind else []
    head += [b"Transfer-Encoding: chunked"] if is_chunked else []
    head += [b"Server: x"] * dice.randint(0, 2)
    begin = end.join(head) + end * dice.choice([2, 2, 2, 3])
    if not status and dice.random() < 0.5:
        begin = b""  # the stream begins at once
    if what in ("status", "page"):
        return begin + b"<html>no</html>", [], str(status.split()[1].decode()), False
    pictures = [dice.choice(WHOLE) for _ in range(dice.randint(2, 6))]
    body = b""
    for number, picture in enumerate(pictures):
        data = picture
        if what == "cut":
            data = picture[: dice.randint(len(picture) // 4, len(picture) - 2)]
        elif what == "other":
            data = bytes(dice.randrange(128) for _ in range(200))
        fields = [
            dice.choice(
                [b"Content-Type: image/jpeg", b"content-type:image/webp", b"X-Timestamp: 0.1"]
            )
        ]
        length = len(data) + dice.choice([0, 0, -100, -1, 1, 5000])
        name = dice.choice([b"Content-Length", b"X-Original-Content-Length", b""])
        fields += [name + b": %d" % length] if name else []
        dashes = dice.choice([b"--", b"--", b"", b"----"])
        if what != "none":
            body += dashes + dice.choice([boundary, b"another"]) + end
            body += end.join(fields) + end * dice.choice([1, 2, 2, 2, 3]) + data
            body += dice.choice([end, b"", end * 2]) if number < len(pictures) - 1 else b""
    if is_chunked:
        chunks = b"".join(b"%x" % len(p) + end + p + end for p in cut(body, dice))
        body = chunks
    words = {"cut": "cut", "other": "without any JPEG or PNG", "none": "", "whole": ""}[what]
    return begin + body, pictures if what == "whole" else [], words, dice.random() < 0.5


def test_of_any_stream_a_picture_is_shown_or_the_reason_is_said() -> None:
    n_shown = n_said = 0
    for seed in range(STREAMS):
        dice = random.Random(seed)
        data, pictures, words, stalls = made_stream(dice)
        shown, said, _ = watch([cut(data, dice)], stalls=stalls)
        assert said and "hush" not in said, seed
        if pictures:
            jpegs = [frame.data for frame in shown if frame.encoding is Encoding.JPEG]
            assert shown and set(jpegs) <= set(pictures), (seed, said)
            last = shown[-1]
            decoded = cv2.imdecode(np.frombuffer(pictures[-1], np.uint8), 1)
            assert (last.height, last.width) == decoded.shape[:2], seed
            n_shown += 1
        else:
            assert (words in said or "did not end" in said) and not shown, (
                seed,
                said,
            )
            n_said += 1
    print(
        f"{STREAMS} streams: {n_shown} showed their pictures, {n_said} said why not, 0 were silent"
    )
    assert n_shown > STREAMS / 4 and n_said > STREAMS / 4


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
    answer = Answer(FakeSocket(pieces, VirtualClock(), stalls=False))  # type: ignore[arg-type]
    answer.begin()
    return answer, b"".join(iter(lambda: answer.read1(1000), b""))


@pytest.mark.parametrize("size", [1, 2, 5, 1000])
def test_chunks_however_they_are_cut(size: int) -> None:
    head = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
    data = b"5\r\nhello\r\n1;x=y\r\n \nA\nwide world\r\n0\r\n\r\n"
    assert read_whole(head + data, size)[1] == b"hello wide world"
    assert read_whole(head + b"--frame\r\nplain")[1] == b"--frame\r\nplain"


def test_a_head_may_lack_what_it_likes() -> None:
    for text in (b"HTTP/1.1 206 x\r\nA: b\r\n\r\nbody", b"\r\nHTTP 206\nA: b\n\nbody"):
        answer, body = read_whole(text)
        assert answer.status == 206 and answer.headers["a"] == "b"
        assert body == b"body"


@pytest.mark.parametrize(
    "strange", ["junk", "Server : x", " folded", "Realm: K\u00fcche", ":", "HTTP/1.1 200 OK"]
)
def test_a_strange_line_of_a_head_costs_no_other(strange: str) -> None:
    fields = ["Transfer-Encoding : chunked", "content-type:image/jpeg"]
    for at, coding in ((0, "utf-8"), (1, "latin-1"), (2, "latin-1")):
        head = ["HTTP/1.1 200 OK", *fields[:at], strange, *fields[at:], "", ""]
        answer, body = read_whole("\r\n".join(head).encode(coding) + b"2\r\nab\r\n1\r\nc\r\n0\r\n")
        assert answer.headers["content-type"] == "image/jpeg" and body == b"abc"


def answer(status: str, *fields: str) -> list[bytes]:
    return ["\r\n".join([f"HTTP/1.1 {status}", *fields, "", ""]).encode()]


STREAM = [*answer("200 OK", "Content-Type: multipart/x-mixed-replace; boundary=x"), JPEGS[1]]
DIGEST = 'WWW-Authenticate: Digest realm="cam", nonce="abc", qop="auth,auth-int", algorithm=MD5'


def test_a_redirect_is_followed_and_takes_no_password_elsewhere() -> None:
    source = "http://me:secret@camera.local/old"
    shown, _, asked = watch([answer("302 Found", "Location: /new"), list(STREAM)], source=source)
    assert shown and b"GET /new " in asked[1] and b"Authorization" in asked[1]
    shown, _, asked = watch(
        [answer("301 Moved", "Location: http://other.local:81/new"), list(STREAM)], source=source
    )
    assert shown and b"Host: other.local:81" in asked[1] and b"Authorization" not in asked[1]


@pytest.mark.parametrize("place", ["ftp://a/b", "http://[", "http://a:99999999/"])
def test_a_redirect_to_nowhere_is_said(place: str) -> None:
    assert "an invalid address" in watch([answer("302 Found", f"Location: {place}")])[1]


def test_a_redirect_in_a_circle_is_said() -> None:
    assert "circle" in watch([answer("302 Found", "Location: /") for _ in range(9)])[1]


@pytest.mark.parametrize("status", ["300 Choose", "302 Found", "304 Not Modified"])
def test_an_answer_that_leads_nowhere_is_no_circle(status: str) -> None:
    assert f"/stream answers {status[:3]}: " in watch([answer(status)])[1]


@pytest.mark.parametrize("letter", ["\u00fc", "\u00c5", "\u041c", "\u0105", "\u4e1c"])
def test_a_redirect_may_have_letters_of_any_language(letter: str) -> None:
    """In some encodings these bytes are line ends."""
    asked = watch([answer("302 Found", f"Location: /k{letter}che"), list(STREAM)])[2]
    assert asked[1].startswith(f"GET /k{quote(letter)}che ".encode())


@pytest.mark.parametrize(
    "other", ["http://cam", "https://cam:444", "https://cam2", "http://cam:443"]
)
def test_the_password_is_shown_to_the_address_that_was_given_alone(other: str) -> None:
    line = CameraLine(urlsplit("https://me:secret@Cam/stream"))
    for address, is_shown in ((other, False), ("https://cam:443", True)):
        assert line.shows_user(address + "/stream") is is_shown


def test_digest_is_answered_and_what_does_not_fit_is_said() -> None:
    source = "http://me:secret@camera.local/stream?a=b"
    shown, _, asked = watch([answer("401 No", DIGEST), list(STREAM)], source=source)
    assert shown and b'Authorization: Digest username="me", realm="cam"' in asked[1]
    assert b'uri="/stream?a=b"' in asked[1] and b"secret" not in asked[0] + asked[1]
    _, said, _ = watch([answer("401 No", DIGEST), answer("401 No", DIGEST)], source=source)
    assert "does not accept this user" in said
    assert "--source http://USER" in watch([answer("401 No", DIGEST)])[1]


@pytest.mark.parametrize(
    "unknown",
    [
        DIGEST.replace("MD5", "SHA3-x"),
        DIGEST.replace("cam", "K\u00fcche"),
        DIGEST + ", opaque=",
        DIGEST.replace("nonce", "none"),
        "WWW-Authenticate: Digest x",
    ],
)
def test_a_digest_that_is_not_known_is_said(unknown: str) -> None:
    source = "http://me:secret@camera.local/stream"
    assert "unsupported kind" in watch([answer("401 No", unknown)], source=source)[1]


@pytest.mark.parametrize(
    ("asked", "hashed"), [(["MD5"], "md5"), (["md5"], "md5"), (["MD5", "SHA-256"], "sha256")]
)
def test_the_digest_is_that_of_rfc_7616(asked: list[str], hashed: str) -> None:
    source = "http://me:secret@camera.local/stream?a=b"
    challenges = [DIGEST.replace("MD5", algorithm) for algorithm in asked]
    said = watch([answer("401 No", *challenges), list(STREAM)], source=source)[2][1].decode()
    given = dict(re.findall(r'(\w+)="?([^",]*)', said.partition("Authorization: Digest ")[2]))

    def h(text: str) -> str:
        return hashlib.new(hashed, text.encode()).hexdigest()

    proof = [given["nonce"], given["nc"], given["cnonce"], "auth", h("GET:/stream?a=b")]
    assert given["response"] == h(":".join([h("me:cam:secret"), *proof]))


def test_a_user_may_have_letters_of_any_language() -> None:
    source = "http://\u0436\u0443\u043a:secret@camera.local/stream"
    challenge = DIGEST.replace("MD5", "SHA-256")
    shown, _, asked = watch([answer("401 No", challenge), list(STREAM)], source=source)
    assert shown and 'Digest username="\u0436\u0443\u043a"'.encode() in asked[1]


FAULTS: dict[str, Callable[[], str]] = {
    "without an answer": lambda: watch([[]])[1],
    "sends nothing": lambda: watch([STREAM[:1]], stalls=True)[1],
    "closes the connection after one picture": lambda: watch([list(STREAM)])[1],
    "a web page": lambda: watch([answer("200 OK", "Content-Type: text/html")])[1],
    "image/webp": lambda: watch([[*STREAM[:1], b"Content-Type: image/webp\r\n\r\nRIFF" * 9]])[1],
    "did not end": lambda: watch([[*STREAM[:1], JPEGS[1][:-9]]], stalls=True)[1],
}


@pytest.mark.parametrize("words", FAULTS)
def test_the_reason_is_true(words: str) -> None:
    assert words in FAULTS[words]()


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
