"""Secrets: from a variable of the environment, or from a file that only its owner can read. They are never shown."""

import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path

from processors.errors import ConfigurationError

SECRET_BYTES_MAX = 4096
FILE = "file:"


def read_secret(name: str, environment: Mapping[str, str] = os.environ) -> str:
    """The secret that `$NAME` or `file:/path` names. Raises ConfigurationError, which names the place and never the content.

    >>> read_secret("$TOKEN", {"TOKEN": "s3cret"})
    's3cret'
    """
    if name.startswith("$"):
        value = environment.get(name[1:], "").strip()
        if not value:
            raise ConfigurationError(f"the environment has no variable {name[1:]}; set it, or name a file with file:/path")
        return value
    return _from_file(Path(name.removeprefix(FILE)).expanduser())


def _from_file(path: Path) -> str:
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise ConfigurationError(f"the secret's file {path}: {error.strerror or error}; give a file that can be read") from None
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise ConfigurationError(f"{path} is no plain file; a secret has to be in one")
        mode = stat.S_IMODE(status.st_mode)
        if mode & 0o077:
            raise ConfigurationError(f"others than its owner may use {path} (mode {mode:o}); chmod 600 {path}")
        content = file.read(SECRET_BYTES_MAX + 1)
    if len(content) > SECRET_BYTES_MAX:
        raise ConfigurationError(f"{path} holds more than {SECRET_BYTES_MAX} bytes; that is no secret")
    try:
        text = content.decode("utf-8").strip()
    except UnicodeDecodeError:
        raise ConfigurationError(f"{path} is not UTF-8 text") from None
    if not text:
        raise ConfigurationError(f"{path} is empty; write the secret into it")
    return text


def redacted(text: str, secrets: Iterable[str]) -> str:
    """The text without any of these secrets, on one line and short.

    >>> redacted("no route to https://hooks.example/T0/abc", ["https://hooks.example/T0/abc", ""])
    'no route to …'
    """
    for secret in sorted(filter(None, secrets), key=len, reverse=True):
        text = text.replace(secret, "…")
    return " ".join(text.split())[:200]
