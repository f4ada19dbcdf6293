"""The way to the control that the configuration chooses."""

from edge.controls.focas.calls import FocasBackend
from edge.controls.focas.config import Backend, FocasConfig
from edge.controls.focas.ethernet import EthernetBackend
from edge.controls.focas.library import LibraryBackend


def backend_of(config: FocasConfig) -> FocasBackend:
    """A backend, not opened yet."""
    return LibraryBackend(config) if config.backend is Backend.LIBRARY else EthernetBackend(config)
