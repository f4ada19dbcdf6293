"""Packages that a command needs and not every installation has."""

from collections.abc import Iterator
from contextlib import contextmanager

from cnctwin.errors import UsageError


@contextmanager
def needed_by(who: str, extra: str) -> Iterator[None]:
    """Import in here what `who` needs. Raises UsageError, with the extra that brings it, where a package is missing."""
    try:
        yield
    except ModuleNotFoundError as missing:
        raise UsageError(f"{who} needs the package {missing.name}; pip install 'cnctwin[{extra}]' brings it") from None
