"""A preview of what an edge would publish, and a first configuration for a control; neither needs a broker."""

from pathlib import Path

from edge.adapter import Row, adapters, find
from edge.config_file import load
from edge.errors import ConfigError
from sparkplug.shown_address import shown_address


def check(config_path: Path) -> list[Row]:
    """Return what the edge of this file would publish; ConfigError or ConnectionLostError where it cannot work."""
    config = load(config_path)
    return find(config.machine.adapter).describe(config)


def discover(url: str, *, device: str = "") -> str:
    """A configuration for the control at this address, as text; of several devices `device` names one, else it is the first."""
    scheme = url.partition("://")[0].lower()
    for adapter in adapters().values():
        if "://" in url and scheme in adapter.schemes:
            return adapter.draft(url, device)
    known = ", ".join(f"{scheme}:// ({adapter.name})" for adapter in adapters().values() for scheme in adapter.schemes)
    raise ConfigError(f"{shown_address(url)}: no adapter speaks to such an address; there are {known}")
