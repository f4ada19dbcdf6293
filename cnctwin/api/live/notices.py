"""The lines that stand above every view of the page: what is late, what is not let in, and which description is not taken up."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from cnctwin.plant.lags import behind, lag_reports
from cnctwin.plant.quarantine import refusals
from sparkplug.values import Value

REFUSED_MAX = 2
"""Refused devices, and machines, that are named above a view; `/health` and `cnctwin doctor` name more."""


class Notices(NamedTuple):
    """A sentence each; None where there is nothing to say.

    behind: processors that fall behind
    refused: devices and nodes in quarantine, with the reason
    described: machines whose description has a fault, so that another one than the file's is live
    """

    behind: str | None = None
    refused: str | None = None
    described: str | None = None


def notices_of(own: Iterable[tuple[str, Mapping[str, Value]]], faults: Iterable[tuple[str, str]] = ()) -> Notices:
    """Return the notices that follow from the metrics of the processors' nodes, by node, and from faults of descriptions."""
    nodes = list(own)
    return Notices(behind(lag_reports(nodes)), _in_a_line(refusals((), nodes)), _in_a_line(faults))


def _in_a_line(said: Iterable[tuple[str, str]]) -> str | None:
    """Return what is said of some names in one line; None where nothing is.

    >>> _in_a_line([("vmc", "no [axes]"), ("lathe", "no name"), ("mill", "is empty")])
    'vmc: no [axes]; lathe: no name; and 1 more'
    """
    lines = [f"{name}: {text}" for name, text in said]
    more = f"; and {len(lines) - REFUSED_MAX} more" if len(lines) > REFUSED_MAX else ""
    return "; ".join(lines[:REFUSED_MAX]) + more or None
