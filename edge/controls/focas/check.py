"""A preview of an edge for a FANUC control: one handle, one look, the same parser as in operation, no broker."""

from edge.adapter import Row
from edge.controls.focas.config import Backend, Config
from edge.controls.focas.connection import FocasConnection
from edge.controls.focas.cursor import parse, start
from edge.errors import ConnectionLostError
from edge.sample import SampleSet
from edge.sweep import Sweep

EXPERIMENTAL = "FANUC has not published this protocol: put each value beside the control's screen (docs/how-to/edge-focas.md)"


def describe(config: Config) -> list[Row]:
    """Return what would be published for the control that the configuration names; what it refuses is a null with the reason."""
    _, frame = look(config)
    last = {sample.signal: sample for sample in frame.samples}
    rows = []
    for offer in frame.offers or ():
        sample = last.get(offer.signal)
        value, reason = (None, "not reported yet") if sample is None else (sample.value, sample.reason)
        rows.append(Row(offer.signal, offer.source, offer.declared.unit, offer.native_unit, value, reason))
    if config.source.backend is Backend.ETHERNET:
        rows.append(Row("(warning)", f"focas://{config.source.host}:{config.source.port}", "", "", None, EXPERIMENTAL))
    return rows


def _way_out(config: Config, error: str) -> str:
    if "EW_NODLL" in error:
        return "correct focas.library, and put the library for your series beside it"
    return f"is the control on, and does it answer FOCAS on port {config.source.port}?"


def look(config: Config) -> tuple[Sweep, SampleSet]:
    """The first sweep and what it gives; ConnectionLostError where there is none."""
    connection = FocasConnection(config, wait=lambda _: None)
    raw = connection.once()
    if raw is None:
        raise ConnectionLostError(
            f"{connection.last_error}; {_way_out(config, connection.last_error)} (docs/how-to/edge-focas.md)"
        )
    return Sweep.decode(raw), parse(config, start(config), raw)[1]
