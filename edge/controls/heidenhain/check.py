"""A preview of an edge for a HEIDENHAIN control: one look, the same parser as in operation, no broker."""

from edge.adapter import Row
from edge.controls.heidenhain.config import Config
from edge.controls.heidenhain.connection import HeidenhainConnection
from edge.controls.heidenhain.cursor import parse, start
from edge.controls.heidenhain.meaning import source_of
from edge.errors import ConnectionLostError
from edge.sample import UNAVAILABLE, EdgeSample, Offer
from edge.sweep import Sweep

NO_TOOL = "this control does not report it over LSV2; give its PLC address as plc.tool_number, or let program_text be true"


def describe(config: Config) -> list[Row]:
    """Return what would be published for the control that the configuration names."""
    frame = first_look(config)
    offers, last = looked_at_frame(config, frame)
    faults = {source_of(fact.key, config): fact.fault for fact in Sweep.decode(frame).facts if fact.fault}
    rows = [_row(offer, last.get(offer.signal), faults.get(offer.source)) for offer in offers]
    if not any(row.signal == "tool_number" for row in rows):
        rows.append(Row("tool_number", "none", "", "", None, NO_TOOL))
    return rows


def looked_at_frame(config: Config, frame: bytes) -> tuple[tuple[Offer, ...], dict[str, EdgeSample]]:
    """Return what is declared, and the samples of a first look."""
    _, given = parse(config, start(config), frame)
    return given.offers or (), {sample.signal: sample for sample in given.samples}


def first_look(config: Config) -> bytes:
    """One look on a connection of its own; ConnectionLostError where it cannot be had."""
    connection = HeidenhainConnection(config)
    try:
        return connection.look()
    except (OSError, ConnectionLostError) as error:
        why = str(error) or type(error).__name__
        raise ConnectionLostError(
            f"{config.source.url}: {why}; is the control on, the address right, and external access permitted?"
        ) from error
    finally:
        connection.hang_up()


def _row(offer: Offer, sample: EdgeSample | None, fault: str | None) -> Row:
    value, reason = (None, "not reported yet") if sample is None else (sample.value, sample.reason)
    reason = fault if reason == UNAVAILABLE and fault else reason
    return Row(offer.signal, offer.source, offer.declared.unit, offer.native_unit, value, reason)
