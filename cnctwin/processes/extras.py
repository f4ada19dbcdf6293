"""Packages that a part of the program needs and not every installation has."""

from collections.abc import Iterator
from contextlib import contextmanager

from cnctwin.errors import MissingPackageError


@contextmanager
def needed_by(who: str, extra: str) -> Iterator[None]:
    """Import in here what `who` needs. Raises MissingPackageError, with the extra that brings it, where a package is missing."""
    try:
        yield
    except ModuleNotFoundError as missing:
        if missing.name is not None and missing.name.partition(".")[0] == "cnctwin":
            raise  # our own fault
        text = f"{who} needs the package {missing.name}; pip install 'cnctwin[{extra}]' brings it"
        raise MissingPackageError(text) from None
