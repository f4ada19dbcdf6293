"""The edge's own application certificate, and which servers' certificates it trusts.

Our own is self-signed and made once, in `<folder>/own.der` with its key in `own.key` that only the owner can read. A server is
trusted by its certificate's SHA-256 fingerprint in the configuration, or by the certificate itself in `<folder>/trusted`. One
that is not is kept in `<folder>/refused`, so that a person can compare it and move it over.
"""

import hashlib
import os
import socket
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from edge.errors import ConfigError, ConnectionLostError
from edge.state_dir import state_dir

VALID_DAYS = 3650
KEY_BITS = 2048
TRUSTED_FILES_MAX = 1000


@dataclass(frozen=True, slots=True)
class Identity:
    """An application's certificate and key, and the URI that both carry."""

    uri: str
    certificate: Path
    key: Path


def fingerprint(der: bytes) -> str:
    """SHA-256 over the certificate, as hexadecimal digits."""
    return hashlib.sha256(der).hexdigest()


def leaf_of(chain: bytes) -> bytes:
    """The first certificate of a chain of them (part 6, 6.2.6), told by the length in its own head."""
    if len(chain) < 4 or chain[:2] != b"\x30\x82":
        return chain
    return chain[: 4 + int.from_bytes(chain[2:4], "big")]


def folder_of(given: str) -> Path:
    """Return where certificates are kept: the given folder, else `opcua` in the program's state folder."""
    return Path(given) if given else state_dir() / "opcua"


def own_identity(folder: Path, *, name: str = "edge", valid_days: int = VALID_DAYS, is_server: bool = False) -> Identity:
    """Our certificate and key, made where there are none yet or they have expired."""
    uri = f"urn:{socket.gethostname()}:cnctwin:{name}"
    identity = Identity(uri, folder / "own.der", folder / "own.key")
    try:
        if identity.key.exists() and _is_usable(identity):
            return identity
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        key = rsa.generate_private_key(public_exponent=65537, key_size=KEY_BITS)
        _keep_for_owner(
            identity.key,
            key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()),
        )
        _replace(identity.certificate, _self_signed(key, uri, name, valid_days, is_server))
    except OSError as error:
        raise ConfigError(
            f"{folder}: no certificate can be kept there: {error.strerror}; set opcua.certificate_folder"
        ) from error
    return identity


def _is_usable(identity: Identity) -> bool:
    try:
        certificate = x509.load_der_x509_certificate(identity.certificate.read_bytes())
    except (OSError, ValueError):
        return False
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    uris = names.get_values_for_type(x509.UniformResourceIdentifier)
    return identity.uri in uris and certificate.not_valid_after_utc > datetime.now(UTC)


def _self_signed(key: rsa.RSAPrivateKey, uri: str, name: str, valid_days: int, is_server: bool) -> bytes:
    """Make a certificate with the extensions that part 6, 6.2.2 asks of an application instance certificate."""
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"cnctwin {name} at {socket.gethostname()}"[:64])])
    now = datetime.now(UTC)
    usage = x509.KeyUsage(
        digital_signature=True,
        content_commitment=True,
        key_encipherment=True,
        data_encipherment=True,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
    purposes = [ExtendedKeyUsageOID.CLIENT_AUTH, *([ExtendedKeyUsageOID.SERVER_AUTH] if is_server else [])]
    names = [x509.UniformResourceIdentifier(uri), x509.DNSName(socket.gethostname())]
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now, now + timedelta(days=valid_days)) - timedelta(days=1))  # a control's clock may be behind
        .not_valid_after(now + timedelta(days=valid_days))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=False)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .sign(key, hashes.SHA256())
        .public_bytes(serialization.Encoding.DER)
    )


def _keep_for_owner(path: Path, content: bytes) -> None:
    """Never readable by anyone else, not for a moment."""
    fresh = path.with_name(path.name + ".new")
    fresh.unlink(missing_ok=True)
    with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
    fresh.replace(path)


def _replace(path: Path, content: bytes) -> None:
    fresh = path.with_name(path.name + ".new")
    fresh.write_bytes(content)
    fresh.replace(path)


def check_trust(url: str, der: bytes, pinned: str, folder: Path) -> None:
    """ConnectionLostError of one line where this server certificate is not trusted, or not valid now."""
    try:
        certificate = x509.load_der_x509_certificate(der)
    except ValueError as error:
        raise ConnectionLostError(f"{url}: the server shows no certificate that can be read: {error}") from error
    found = fingerprint(der)
    if pinned and found != pinned:
        raise ConnectionLostError(
            f"{url}: the server's certificate has fingerprint {found}, not the {pinned[:16]}… of opcua.server_fingerprint; "
            "if the control was given a new certificate, compare it there and correct the configuration"
        )
    if not pinned and found not in _trusted(folder / "trusted"):
        raise ConnectionLostError(_untrusted(url, der, certificate, folder))
    now = datetime.now(UTC)
    if now > certificate.not_valid_after_utc:
        raise ConnectionLostError(
            f"{url}: the server's certificate expired on {certificate.not_valid_after_utc:%Y-%m-%d}; renew it at the control"
        )
    if now < certificate.not_valid_before_utc:
        raise ConnectionLostError(
            f"{url}: the server's certificate is valid from {certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC on; "
            "set this computer's clock, or the control's and renew the certificate"
        )


def _untrusted(url: str, der: bytes, certificate: x509.Certificate, folder: Path) -> str:
    found = fingerprint(der)
    kept = folder / "refused" / f"{found}.der"
    name = certificate.subject.rfc4514_string()[:80]
    first = f"{url}: the server's certificate ({name}, SHA-256 {found}) is not trusted yet; compare it with the control's, then "
    pin = f"set opcua.server_fingerprint to it (without a file yet: cnctwin edge discover '{url}?server_fingerprint={found}')"
    try:
        kept.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if sum(1 for _ in kept.parent.iterdir()) < TRUSTED_FILES_MAX:
            _replace(kept, der)
    except OSError:
        return f"{first}{pin}"
    return first + f"{pin}, or: mkdir -p {folder}/trusted && mv {kept} {folder}/trusted/"


def _trusted(folder: Path) -> set[str]:
    """The fingerprints of the certificates in a folder, DER or PEM."""
    found: set[str] = set()
    for path in sorted(folder.iterdir())[:TRUSTED_FILES_MAX] if folder.is_dir() else []:
        try:
            raw = path.read_bytes()
            is_text = raw.lstrip().startswith(b"-----BEGIN")
            one = x509.load_pem_x509_certificate(raw) if is_text else x509.load_der_x509_certificate(raw)
        except (OSError, ValueError):
            continue
        found.add(fingerprint(one.public_bytes(serialization.Encoding.DER)))
    return found
