"""Errors of a residual model."""

from twin.errors import TwinError


class ResidualError(TwinError):
    """A residual model that cannot be trained, read or used; the text names the culprit, its value and the way out."""
