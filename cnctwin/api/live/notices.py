"""The lines that stand above every view of the page: what is late, and what is not let in."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from cnctwin.plant.lags import behind, lag_reports
from cnctwin.plant.quarantine import refusals
from sparkplug.values import Value

REFUSED_MAX = 2
"""Refused devices that are named above a view; `/health` names more."""


class Notices(NamedTuple):
    """A sentence each; None where there is nothing to say.

    behind: processors that fall behind
    refused: devices and nodes in quarantine, with the reason
    """

    behind: str | None = None
    refused: str | None = None


def notices_of(own: Iterable[tuple[str, Mapping[str, Value]]]) -> Notices:
    """Return the notices that follow from the metrics of the processors' nodes, by node."""
    nodes = list(own)
    lines = [f"{name}: {text}" for name, text in refusals((), nodes)]
    more = f"; and {len(lines) - REFUSED_MAX} more" if len(lines) > REFUSED_MAX else ""
    return Notices(behind(lag_reports(nodes)), "; ".join(lines[:REFUSED_MAX]) + more or None)
