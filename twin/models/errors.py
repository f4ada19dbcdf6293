"""Errors of the pointer to a model."""

from twin.errors import TwinError


class PointerError(TwinError):
    """A current.json that names no model; the text names the file, what is wrong with it, and the way out."""
