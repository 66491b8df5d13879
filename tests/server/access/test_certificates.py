"""Which certificate a browser that trusts the robot's authority gets, and when it is renewed."""

import datetime as dt
import ssl
from urllib.parse import urlsplit

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from server.access.certificates import Certificates, RenewedCertificates, make_certificates
from server.access.config import NetworkConfig
from server.access.network import host_names, lan_addresses, page_addresses

NOW = dt.datetime.now(dt.UTC)
NEW_YEAR = dt.datetime(1970, 1, 1, 0, 5, tzinfo=dt.UTC)
NAMES = ["localhost", "127.0.0.1", "::1", "drivelesson.local", "laptop", "laptop.local"]


def serving(made: Certificates) -> ssl.SSLContext:
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(made.chain, made.key)
    return server


def handshake(client: ssl.SSLContext, server: ssl.SSLContext, name: str | None = None) -> bytes:
    """Connect in memory; return the server's certificate; SSLError if the client refuses it."""
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
    assert shown and ends[0].version(), "the client has completed the handshake"
    return shown


def certified(made: Certificates, *names: str) -> None:
    """Connect under each name to a server with these files; SSLError if the client refuses it."""
    client = ssl.create_default_context(cafile=made.authority)
    client.verify_flags |= ssl.VERIFY_X509_STRICT
    for name in names:
        handshake(client, serving(made), name)


def test_the_certificate_contains_the_robots_names_on_the_network(tmp_path):
    config = NetworkConfig(host="0.0.0.0", lan=True, tls=True, data=tmp_path)
    made = make_certificates(tmp_path, [*host_names(config), "192.168.1.7"], NOW)
    certified(made, "drivelesson.local", "127.0.0.1", "192.168.1.7")
    authority = made.authority.read_bytes()
    renamed = make_certificates(tmp_path, ["drivelesson.local", "desk", "desk.local"], NOW)
    certified(renamed, "drivelesson.local", "desk.local")
    assert renamed.authority.read_bytes() == authority, "phones trust this authority"


@pytest.mark.parametrize("own", ["131.220.6.5", "2600::7", "192.168.1.7", "fd00::7"])
def test_the_certificate_contains_the_address_that_a_phone_scans(tmp_path, own):
    config = NetworkConfig(host=own, lan=True, tls=True, data=tmp_path)
    made = make_certificates(tmp_path, [*host_names(config), *lan_addresses(config)], NOW)
    certified(made, urlsplit(page_addresses(config)[0]).hostname or "")


@pytest.mark.parametrize(
    "other", ["0.0.0.0", "::", "131.220.6.5", "2001:db8::5", "pc.example", "jürgen", "ü.local"]
)
def test_a_name_that_cannot_be_certified_does_not_affect_the_others(tmp_path, other):
    made = make_certificates(tmp_path, [*NAMES, other], NOW)
    certified(made, "drivelesson.local")
    with pytest.raises((ssl.SSLError, ValueError)):
        certified(made, other)


@pytest.mark.parametrize("year", [1970, 2038])
def test_a_clock_that_is_years_off_does_not_affect_later_starts(tmp_path, year):
    make_certificates(tmp_path, NAMES, dt.datetime(year, 1, 3, tzinfo=dt.UTC))
    certified(make_certificates(tmp_path, NAMES, NOW), "drivelesson.local")


def test_an_authority_that_has_expired_is_made_anew(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        ended = NEW_YEAR + dt.timedelta(days=3650)
        patch.setattr("server.access.certificates._EVER", (NEW_YEAR, ended))
        make_certificates(tmp_path, NAMES, NEW_YEAR)
    certified(make_certificates(tmp_path, NAMES, NOW), "drivelesson.local")


def test_a_certificate_of_1970_is_renewed_when_the_clock_is_set(tmp_path):
    made = RenewedCertificates(tmp_path, ["drivelesson.local"], NEW_YEAR)
    server, anybody = serving(made.files), ssl.create_default_context()
    anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
    made.use(server)
    authority = made.files.authority.read_bytes()
    before = handshake(anybody, server)
    assert made.renew(["drivelesson.local"], NEW_YEAR) is None
    assert made.renew(["drivelesson.local"], NOW) == "the clock was set"
    assert handshake(anybody, server) != before, "the server in use has the new certificate"
    assert made.renew(["drivelesson.local"], NOW) is None
    both = ["drivelesson.local", "192.168.1.7"]
    assert made.renew(both, NOW) == "names or addresses changed"
    assert made.renew(both, NOW + dt.timedelta(days=380))
    assert made.renew(both, NEW_YEAR), "the clock was set back"
    assert made.files.authority.read_bytes() == authority, "phones trust this authority"


def test_a_persons_own_authority_may_certify_any_name(tmp_path):
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
    certified(made, "robot.school.example", "drivelesson.local")
