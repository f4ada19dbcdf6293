"""A preview of an edge for MTConnect: one probe, one current, the same parser as in operation, no broker."""

from edge.adapter import Row
from edge.controls.mtconnect.asset_watch import watch_of
from edge.controls.mtconnect.connection import error_document, fetch
from edge.controls.mtconnect.cursor import Config, choose_device, next_request, parse, start
from edge.controls.mtconnect.documents import DevicesDocument, parse_document
from edge.controls.mtconnect.mapping import assign
from edge.controls.mtconnect.state import Cursor, Phase
from edge.errors import ConfigError, ConnectionLostError, DocumentError
from edge.sample import EdgeSample, Offer


def describe(config: Config) -> list[Row]:
    """Return what would be published for the control that the configuration names."""
    cursor = start(config)
    offers: tuple[Offer, ...] = ()
    last: dict[str, EdgeSample] = {}
    while cursor.phase is not Phase.SAMPLE:
        raw = _fetched(config, cursor)
        if cursor.phase is Phase.PROBE:
            _check_names(config, raw)
        cursor, frame = parse(config, cursor, raw)
        if frame.error is not None and cursor.phase is not Phase.SAMPLE:
            raise ConnectionLostError(f"{config.path}: {config.source.url}: {frame.error}")
        offers = offers if frame.offers is None else frame.offers
        last |= {sample.signal: sample for sample in frame.samples}
    return [_row(config, offer, last.get(offer.signal)) for offer in offers]


def _fetched(config: Config, cursor: Cursor) -> bytes:
    """The next document; an asset that cannot be had is told like one that the agent does not know."""
    try:
        return fetch(config, next_request(config, cursor))
    except ConnectionLostError as error:
        if cursor.phase is not Phase.ASSET:
            raise
        return error_document(str(error))


def _check_names(config: Config, raw: bytes) -> None:
    """A device, spindle or data item that is not there is a mistake of the configuration, not of the connection."""
    try:
        document = parse_document(raw)
        if isinstance(document, DevicesDocument):
            device = choose_device(document.devices, config.source.device)
            assign(device, config.signals, config.source.spindle, config.chosen)
            watch_of(device, config.source.tool_asset)
    except ConfigError as error:
        raise ConfigError(f"{config.path}: {error}") from error
    except DocumentError as error:
        raise ConnectionLostError(f"{config.source.url}/probe: {error}; is this the address of an MTConnect agent?") from error


def _row(config: Config, offer: Offer, sample: EdgeSample | None) -> Row:
    section = config.signals.get(offer.signal)
    native = (section.native_unit if section else "") or offer.native_unit
    value, reason = (None, "not reported yet") if sample is None else (sample.value, sample.reason)
    return Row(offer.signal, offer.source, offer.declared.unit, native, value, reason)
