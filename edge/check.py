"""What an edge would publish, and a first configuration for a control; neither needs a broker."""

from pathlib import Path

from edge.adapter import Row, adapters
from edge.config_file import load
from edge.errors import ConfigError


def check(config_path: Path) -> list[Row]:
    """What the edge of this file would publish; ConfigError or ConnectionLostError where it cannot work."""
    config = load(config_path)
    return adapters()[config.machine.adapter].describe(config)


def discover(url: str, *, device: str = "", adapter: str = "mtconnect") -> str:
    """A configuration for the control at this address, as text; of several devices `device` names one, else it is the first."""
    if adapter not in adapters():
        raise ConfigError(f"adapter {adapter!r}: no such adapter; there are {', '.join(sorted(adapters()))}")
    return adapters()[adapter].draft(url, device)
