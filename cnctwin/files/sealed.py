"""Seals answers before they are asked for: a salted SHA-256 that is shown first, and opened with salt and answers afterwards."""

import hashlib
import hmac
import json
import secrets
from dataclasses import dataclass
from pathlib import Path

from cnctwin.errors import ApplicationError


class SealError(ApplicationError):
    """Answers that are not the ones which were sealed."""


@dataclass(frozen=True, slots=True)
class Seal:
    """The hash that is shown before: SHA-256 of salt and text, in hexadecimal."""

    digest: str


@dataclass(frozen=True, slots=True)
class Sealed:
    """The salt and text kept until the seal is opened."""

    seal: Seal
    salt: str
    text: str


def seal(text: str, salt: str | None = None) -> Sealed:
    """Seals `text` with a salt of 32 bytes, drawn where none is given.

    >>> seal("answers", salt="00").seal.digest[:16]
    'd9b02dd900bae2be'
    """
    drawn = secrets.token_hex(32) if salt is None else salt
    return Sealed(Seal(_digest(text, drawn)), drawn, text)


def opened(shown: Seal, salt: str, text: str) -> str:
    """The text, where it is the one that was sealed. Raises SealError where it is not."""
    if not hmac.compare_digest(shown.digest, _digest(text, salt)):
        raise SealError(
            f"the answers are not those that were sealed as {shown.digest[:16]}…; they were changed, or belong to another check"
        )
    return text


def _digest(text: str, salt: str) -> str:
    return hashlib.sha256(f"{salt}\n{text}".encode()).hexdigest()


def write_sealed(sealed: Sealed, path: Path) -> None:
    """Write salt and text to a file that only its owner may read; it appears as a whole."""
    fresh = path.with_name(path.name + ".new")
    fresh.touch(0o600)
    fresh.write_text(json.dumps({"sha256": sealed.seal.digest, "salt": sealed.salt, "text": sealed.text}), encoding="utf-8")
    fresh.replace(path)


def read_sealed(path: Path) -> Sealed:
    """Return what such a file holds. Raises SealError where there is none, or where it was changed."""
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
        found = Sealed(Seal(str(held["sha256"])), str(held["salt"]), str(held["text"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SealError(f"{path}: holds nothing sealed: {error}; name the file that `--sealed` wrote") from None
    opened(found.seal, found.salt, found.text)
    return found
