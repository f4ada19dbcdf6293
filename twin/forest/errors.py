"""Errors of a forest."""

from twin.errors import TwinError


class ForestError(TwinError):
    """A forest that cannot be flattened or read, or a row that it cannot score."""
