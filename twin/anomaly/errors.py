"""Errors of an anomaly model."""

from twin.errors import TwinError


class ModelError(TwinError):
    """A model that cannot be trained, read or used."""
