"""The certificate that a browser gets if it trusts the robot's authority."""

from __future__ import annotations

import datetime as dt
import ssl
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from server.access.certificates import Certificates, make_certificates
from server.access.config import NetworkConfig
from server.access.network import host_names, lan_addresses, page_addresses

NOW = dt.datetime.now(dt.UTC)
NAMES = ["localhost", "127.0.0.1", "::1", "drivelesson.local", "laptop", "laptop.local"]


def serving(made: Certificates) -> ssl.SSLContext:
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(made.chain, made.key)
    return server


def handshake(client: ssl.SSLContext, server: ssl.SSLContext, name: str | None = None) -> bytes:
    """Connect in memory; return the server's certificate, or raise SSLError if it is refused."""
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(down, up, server_hostname=name),
        server.wrap_bio(up, down, server_side=True),
    ]
    for end in ends * 3:
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            continue
    shown = ends[0].getpeercert(binary_form=True)
    assert shown and ends[0].version(), "the client has agreed"
    return shown


def _shake_hands(made: Certificates, name: str) -> None:
    """Request a name from a server with these files; SSLError if the client refuses it."""
    client = ssl.create_default_context(cafile=made.authority)
    client.verify_flags |= ssl.VERIFY_X509_STRICT
    handshake(client, serving(made), name)


def test_the_certificate_contains_the_robots_names_on_the_network(tmp_path: Path) -> None:
    config = NetworkConfig(host="0.0.0.0", lan=True, tls=True, data=tmp_path)
    made = make_certificates(tmp_path, [*host_names(config), "192.168.1.7"], NOW)
    for name in ("drivelesson.local", "127.0.0.1", "192.168.1.7"):
        _shake_hands(made, name)


@pytest.mark.parametrize(
    "other",
    ["0.0.0.0", "::", "131.220.6.5", "2001:db8::5", "pc.example", "jürgen", "ü.local"],
)
def test_a_name_that_cannot_be_certified_does_not_affect_the_others(
    tmp_path: Path, other: str
) -> None:
    made = make_certificates(tmp_path, [*NAMES, other], NOW)
    _shake_hands(made, "drivelesson.local")
    with pytest.raises((ssl.SSLError, ValueError)):
        _shake_hands(made, other)


@pytest.mark.parametrize("own", ["131.220.6.5", "100.64.0.1", "2600::7", "192.168.1.7", "fd00::7"])
def test_the_certificate_contains_the_address_that_a_phone_scans(tmp_path: Path, own: str) -> None:
    config = NetworkConfig(host=own, lan=True, tls=True, data=tmp_path)
    made = make_certificates(tmp_path, [*host_names(config), *lan_addresses(config)], NOW)
    _shake_hands(made, urlsplit(page_addresses(config)[0]).hostname or "")


def test_a_computer_may_be_renamed(tmp_path: Path) -> None:
    before = make_certificates(tmp_path, NAMES, NOW).authority.read_bytes()
    made = make_certificates(tmp_path, ["drivelesson.local", "desk", "desk.local"], NOW)
    _shake_hands(made, "drivelesson.local")
    _shake_hands(made, "desk.local")
    assert made.authority.read_bytes() == before, "phones trust that one"


@pytest.mark.parametrize("year", [1970, 2038])
def test_a_clock_that_is_years_off_does_not_affect_later_starts(tmp_path: Path, year: int) -> None:
    make_certificates(tmp_path, NAMES, dt.datetime(year, 1, 3, tzinfo=dt.UTC))
    _shake_hands(make_certificates(tmp_path, NAMES, NOW), "drivelesson.local")


def test_an_authority_that_has_expired_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    began = dt.datetime(1970, 1, 2, tzinfo=dt.UTC)
    with monkeypatch.context() as patch:
        patch.setattr("server.access.certificates._EVER", (began, began + dt.timedelta(days=3650)))
        make_certificates(tmp_path, NAMES, began)
    _shake_hands(make_certificates(tmp_path, NAMES, NOW), "drivelesson.local")


def test_a_persons_own_authority_may_certify_any_name(tmp_path: Path) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "A school")])
    builder = x509.CertificateBuilder(
        name, name, key.public_key(), 1, NOW - dt.timedelta(days=1), NOW + dt.timedelta(days=9)
    )
    for extension, is_critical in (
        (x509.BasicConstraints(ca=True, path_length=None), True),
        (x509.KeyUsage(False, False, False, False, False, True, True, False, False), True),
        (x509.SubjectKeyIdentifier.from_public_key(key.public_key()), False),
    ):
        builder = builder.add_extension(extension, critical=is_critical)
    (tmp_path / "ca.crt").write_bytes(builder.sign(key, SHA256()).public_bytes(Encoding.PEM))
    (tmp_path / "ca.key").write_bytes(
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    made = make_certificates(tmp_path, ["robot.school.example", "drivelesson.local"], NOW)
    _shake_hands(made, "robot.school.example")
    _shake_hands(made, "drivelesson.local")
