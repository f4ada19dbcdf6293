"""Errors of a transient.

TwinError
└── TransientError    captures that no template can be learned from, or a model that cannot be used
"""

from twin.errors import TwinError


class TransientError(TwinError):
    """Captures that no template can be learned from, or a model that cannot be used."""
