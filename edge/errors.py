"""Errors of an edge.

EdgeError
├── ConfigError            a configuration that cannot be used: it names file, key, value and the way out
├── DocumentError          bytes that are no document of the control, or one beyond the bounds
├── ConnectionLostError    the control does not answer, or not in its protocol
└── StoreError             the store on the disk cannot be read or written
"""


class EdgeError(Exception):
    """The root of all errors of this package."""


class ConfigError(EdgeError):
    """A configuration that cannot be used."""


class DocumentError(EdgeError):
    """Bytes that are no document of the control, or one beyond the bounds."""


class ConnectionLostError(EdgeError):
    """The control does not answer, or not in its protocol."""


class StoreError(EdgeError):
    """The store on the disk cannot be read or written."""
