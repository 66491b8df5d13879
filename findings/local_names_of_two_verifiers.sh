#!/usr/bin/env bash
# cryptography 50.0.2 (PyPI) and OpenSSL, as used by Python's ssl: certificates for names of a local network.
#
# Guess before running: both verifiers of a server's certificate agree on names such as `my_robot.local` and
# `*.local`, and on a certificate authority that is limited to `.local`.
# Outcome: wrong in all three cases, and not always in the same direction (OpenSSL 3.0.19):
#   my_robot.local          OpenSSL accepts it; cryptography: "invalid domain name"
#   *.local for robot.local OpenSSL: host name mismatch, a wildcard needs two more labels; cryptography accepts it
#   limited to `.local`     OpenSSL accepts the leading dot; cryptography: "malformed DNS name constraint"
# Both accept an authority that is limited to `local`, without the dot, and plain names.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check cryptography==50.0.2
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import datetime as dt
import ssl

import cryptography
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.verification import PolicyBuilder, Store

NOW = dt.datetime.now(dt.timezone.utc)


def begin(subject, key):
    names = [x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, one)]) for one in (subject, "authority")]
    return x509.CertificateBuilder(
        names[1], names[0], key.public_key(), x509.random_serial_number(), NOW - dt.timedelta(1), NOW + dt.timedelta(90)
    )


def usage(signs):
    return x509.KeyUsage(not signs, False, False, False, False, signs, signs, False, False)


def make(host, limit):
    keys = [ec.generate_private_key(ec.SECP256R1()) for _ in range(2)]
    own = x509.SubjectKeyIdentifier.from_public_key(keys[0].public_key())
    authority = begin("authority", keys[0]).add_extension(x509.BasicConstraints(True, 0), True)
    authority = authority.add_extension(usage(True), True).add_extension(own, False)
    if limit:
        authority = authority.add_extension(x509.NameConstraints([x509.DNSName(limit)], None), True)
    server = begin("robot", keys[1]).add_extension(x509.BasicConstraints(False, None), True)
    server = server.add_extension(usage(False), True)
    server = server.add_extension(x509.ExtendedKeyUsage([x509.oid.ExtendedKeyUsageOID.SERVER_AUTH]), False)
    server = server.add_extension(x509.SubjectAlternativeName([x509.DNSName(host)]), False)
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(keys[0].public_key())
    server = server.add_extension(issuer, False)
    return authority.sign(keys[0], SHA256()), server.sign(keys[0], SHA256()), keys[1]


def by_openssl(authority, server, key, asked):
    with open("server.pem", "wb") as file:
        file.write(server.public_bytes(Encoding.PEM))
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    client = ssl.create_default_context(cadata=authority.public_bytes(Encoding.PEM).decode())
    other = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    other.load_cert_chain("server.pem")
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [client.wrap_bio(down, up, server_hostname=asked), other.wrap_bio(up, down, server_side=True)]
    try:
        for end in ends * 3:
            try:
                end.do_handshake()
            except ssl.SSLWantReadError:
                pass
        return True
    except ssl.SSLError:
        return False


def by_cryptography(authority, server, asked):
    try:
        verifier = PolicyBuilder().store(Store([authority])).build_server_verifier(x509.DNSName(asked))
        verifier.verify(server, [])
        return True
    except Exception:
        return False


seen = {}
for host, limit, asked in (
    ("robot.local", None, "robot.local"),
    ("robot.local", "local", "robot.local"),
    ("my_robot.local", None, "my_robot.local"),
    ("*.local", None, "robot.local"),
    ("robot.local", ".local", "robot.local"),
):
    authority, server, key = make(host, limit)
    seen[host, limit] = (by_openssl(authority, server, key, asked), by_cryptography(authority, server, asked))
    print(f"{host:15} limited to {limit or 'nothing':8} (OpenSSL, cryptography) = {seen[host, limit]}")
print(f"cryptography {cryptography.__version__}, {ssl.OPENSSL_VERSION}")
expected = [(True, True), (True, True), (True, False), (False, True), (True, False)]
raise SystemExit(list(seen.values()) != expected)
PY
