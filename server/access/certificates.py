"""A local certificate authority, so that a phone gets a secure context.

The authority's key stays in the data folder. Name constraints limit the authority to private names
and addresses, so no browser accepts its certificate for a public site.
"""

from __future__ import annotations

import datetime as dt
import re
import ssl
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robot.errors import ConfigurationError, MissingExtraError, told_as
from robot.store.folder import write_whole
from server.access.config import Network, read_networks
from server.config import as_address

try:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
except ImportError as error:
    raise MissingExtraError("--tls", "tls") from error

_PRIVATE = read_networks(
    "10.0.0.0/8,172.16.0.0/12,192.168.0.0/16,127.0.0.0/8,169.254.0.0/16,::1/128,fc00::/7,fe80::/10"
)
_Authority = tuple[x509.Certificate, ec.EllipticCurvePrivateKey]
_Extensions = list[tuple[x509.ExtensionType, bool]]
"""Certificate extensions, each with a flag that says whether it is critical."""
_EVER = dt.datetime(2000, 1, 1, tzinfo=dt.UTC), dt.datetime(2049, 12, 31, tzinfo=dt.UTC)
"""Validity of the authority's certificate; long, because the robot's clock may be years off."""
_RENEWED_BEFORE = dt.timedelta(days=30)
"""A certificate is renewed when its remaining validity is less than this."""
_A_DAY, _MOST = dt.timedelta(days=1), dt.timedelta(days=397)  # phones refuse a longer validity


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificates:
    """Key and certificate files for uvicorn, and the authority's certificate for the phone."""

    key: Path
    chain: Path
    authority: Path


def make_certificates(folder: Path, names: Sequence[str], now: dt.datetime) -> Certificates:
    """Make a server certificate, and the authority if it is missing or has expired.

    The certificate contains only those of `names` that the authority's constraints permit, because
    browsers refuse a certificate with any other name. Raises ConfigurationError if the folder
    cannot be written or has invalid files.
    """
    files = Certificates(
        key=folder / "server.key", chain=folder / "server.crt", authority=folder / "ca.crt"
    )
    about = f"the certificates in {folder} cannot be made"
    with told_as(ConfigurationError, about, OSError, ValueError, do="repair or remove that folder"):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        authority = _load_or_make_authority(folder, names, now)
        key = ec.generate_private_key(ec.SECP256R1())
        issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority[1].public_key())
        extensions: _Extensions = [
            (x509.BasicConstraints(ca=False, path_length=None), True),
            (_key_usage(signs_certificates=False), True),
            (x509.ExtendedKeyUsage([x509.oid.ExtendedKeyUsageOID.SERVER_AUTH]), False),
            (x509.SubjectAlternativeName(_vouched_for(names, authority[0])), False),
            (issuer, False),
        ]
        valid = now - _A_DAY, now + _MOST  # begin a day early: the clock may be wrong
        certificate = _sign("Drivelesson", key, authority, valid, extensions)
        write_whole(files.key, _key_pem(key), mode=0o600)
        write_whole(files.chain, _pem(certificate) + _pem(authority[0]), mode=0o600)
    return files


class RenewedCertificates:
    """A server's certificate, which is renewed if the server's names change or the clock is set.

    New connections get the new certificate from the same `SSLContext`; open ones keep the old.
    """

    def __init__(self, folder: Path, names: Sequence[str], now: dt.datetime) -> None:
        self._folder, self._names = folder, frozenset(names)
        self.files = make_certificates(folder, names, now)
        self._made = now
        self._context: ssl.SSLContext | None = None

    def use(self, context: ssl.SSLContext) -> None:
        """Remember the running server's TLS context, to load renewed certificates into it."""
        self._context = context

    def renew(self, names: Sequence[str], now: dt.datetime) -> str | None:
        """Make a new certificate if the names changed, the clock was set, or the old one expires.

        If the new certificate cannot be written, the previous certificate stays in use.

        Returns:
            The reason for the new certificate; None if the old one is still good.
        """
        is_outdated = not self._made - _A_DAY < now < self._made + _MOST - _RENEWED_BEFORE
        if not is_outdated and self._names == frozenset(names):
            return None
        why = "the clock was set" if is_outdated else "names or addresses changed"
        self.files = make_certificates(self._folder, names, now)
        self._names, self._made = frozenset(names), now
        if self._context is not None:
            self._context.load_cert_chain(self.files.chain, self.files.key)
        return why


def _load_or_make_authority(folder: Path, names: Sequence[str], now: dt.datetime) -> _Authority:
    key_file, certificate_file = folder / "ca.key", folder / "ca.crt"
    if key_file.exists() and certificate_file.exists():
        key = serialization.load_pem_private_key(key_file.read_bytes(), None)
        certificate = x509.load_pem_x509_certificate(certificate_file.read_bytes())
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ValueError("ca.key is not an elliptic curve key")
        if now < certificate.not_valid_after_utc:
            return certificate, key
    key = ec.generate_private_key(ec.SECP256R1())
    extensions: _Extensions = [
        (x509.BasicConstraints(ca=True, path_length=0), True),
        (_key_usage(signs_certificates=True), True),
        (_only_private(names), True),
        (x509.SubjectKeyIdentifier.from_public_key(key.public_key()), False),
    ]
    certificate = _sign("Drivelesson on this network", key, None, _EVER, extensions)
    write_whole(key_file, _key_pem(key), mode=0o600)
    write_whole(certificate_file, _pem(certificate), mode=0o600)
    return certificate, key


def _sign(
    name: str,
    key: ec.EllipticCurvePrivateKey,
    authority: _Authority | None,
    valid: tuple[dt.datetime, dt.datetime],
    extensions: _Extensions,
) -> x509.Certificate:
    """Return a certificate of `key`, signed by `authority`, or by `key` if `authority` is None."""
    subject = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, name)])
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(authority[0].subject if authority else subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(valid[0])
        .not_valid_after(valid[1])
    )
    for extension, is_critical in extensions:
        builder = builder.add_extension(extension, critical=is_critical)
    return builder.sign(authority[1] if authority else key, hashes.SHA256())


def _only_private(names: Sequence[str]) -> x509.NameConstraints:
    domains = ["local", "localhost", *(n for n in names if re.fullmatch(r"[\w-]+", n, re.ASCII))]
    named = [x509.DNSName(domain) for domain in dict.fromkeys(domains)]
    return x509.NameConstraints([*named, *map(x509.IPAddress, _PRIVATE)], excluded_subtrees=None)


def _key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    unused = ("content_commitment", "key_encipherment", "data_encipherment", "key_agreement")
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        **dict.fromkeys((*unused, "encipher_only", "decipher_only"), False),
    )


def _vouched_for(names: Sequence[str], authority: x509.Certificate) -> list[x509.GeneralName]:
    """Return the names that the authority's constraints permit in a certificate."""
    found = [_general_name(name) for name in names if name.isascii()]
    try:
        limits = authority.extensions.get_extension_for_class(x509.NameConstraints).value
    # the folder has a certificate authority that another program made
    except x509.ExtensionNotFound:
        return found
    permitted = [one.value for one in limits.permitted_subtrees or ()]
    return [name for name in found if any(_is_within(name, one) for one in permitted)]


def _general_name(name: str) -> x509.GeneralName:
    address = as_address(name)
    return x509.DNSName(name) if address is None else x509.IPAddress(address)


def _is_within(name: x509.GeneralName, permitted: str | Network) -> bool:
    if isinstance(name, x509.IPAddress):
        return isinstance(permitted, Network) and name.value in permitted
    return f".{name.value}".endswith(f".{permitted}")


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
