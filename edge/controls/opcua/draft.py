"""A first configuration from what a server shows of itself: which of the models that we know it follows, and what that gives.

The address may say how to get in, since there is no file yet: `?security=none`, `?username=…&password_env=…`,
`?server_fingerprint=…`.
"""

from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qsl

from pydantic import ValidationError

from edge.config import EdgeConfig, faults_in
from edge.controls.opcua.alarm_samples import Heard
from edge.controls.opcua.check import alarm_rows, read_all, read_events, run
from edge.controls.opcua.config import Config, OpcUaConfig
from edge.controls.opcua.cursor import parse, start
from edge.controls.opcua.library import require
from edge.controls.opcua.point import maps
from edge.errors import ConfigError, ConnectionLostError
from edge.sample import EMPTY, SampleSet
from edge.signals import signal
from edge.sweep import Sweep
from edge.units import conversion

SHOWN_MAX, SHOWN_ALARMS_MAX = 200, 20
_NO_FILE = Path("the address")  # what messages name in place of a file
_UNITS = {
    "m/min": "METER/MINUTE",
    "mm/s": "MILLIMETER/SECOND",
    "in/min": "INCH/MINUTE",
    "in": "INCH",
    "m": "METER",
    "rad": "RADIAN",
}
_BY_ADDRESS = [
    "",
    "# [variables]                     # R parameters and user data (GUD), by number or path; signal variable_<name>",
    '# part_width = { address = "R10", unit = "mm" }',
    "# [plc]                           # PLC addresses as the maker's lists have them; signal plc_<name>",
    '# coolant_pressure = { address = "DB100.DBW2", unit = "bar", scale = 0.1 }',
    '# door_open = { address = "M5.0", kind = "flag" }',
]


class Looked(NamedTuple):
    """The findings: by model what it gives, the best of them, its units, events and alarms; else the server's variables."""

    found: dict[str, SampleSet]
    best: str
    units: dict[str, str]
    variables: list[str]
    fingerprint: str
    heard: Heard


def draft(url: str, device: str) -> str:
    """A configuration for the server at this address, as TOML. `device`: the machine's name."""
    require()
    config = _config(url)
    return run(_drafted(config, device))


def _config(url: str) -> Config:
    address, _, query = url.partition("?")
    given: dict[str, Any] = dict(parse_qsl(query))
    try:
        return EdgeConfig(path=_NO_FILE, source=OpcUaConfig.model_validate(given | {"url": address, "map": ""}))
    except ValidationError as error:
        raise ConfigError(f"{_NO_FILE}: {'; '.join(faults_in('opcua', OpcUaConfig, error))}") from error


async def _drafted(config: Config, device: str) -> str:
    from edge.controls.opcua import session  # noqa: PLC0415  asyncua is an extra

    async with session.opened(config) as client:
        try:
            looked = await _look(config, client)
        except session.FAILURES as error:
            raise ConnectionLostError(session.one_line(config, error)) from error
    return _text(config, device, looked)


async def _look(config: Config, client: Any) -> Looked:
    from edge.controls.opcua import resolve, session  # noqa: PLC0415  asyncua is an extra

    namespaces = await client.get_namespace_array()
    models = [name for name, known in maps().items() if known.namespace in namespaces]
    found: dict[str, SampleSet] = {}
    units: dict[str, dict[str, str]] = {}
    for name in models:
        with_map = EdgeConfig(source=config.source.model_copy(update={"map": name}))
        nodes = await resolve.resolve(with_map, client)
        facts = await read_all(with_map, client, nodes)
        found[name] = parse(with_map, start(with_map), Sweep("draft", 0, 1, facts).encode())[1]
        units[name] = await session.units_of(client, {one.key: one.node for one in nodes if one.node is not None})
    best = max(models, key=lambda name: _worth(name, found[name]), default="")
    with_best = EdgeConfig(source=config.source.model_copy(update={"map": best}))
    spoken = await read_events(with_best, client)
    heard = parse(with_best, start(with_best), Sweep("draft", 0, 1, spoken).encode())[0].heard
    shown = [] if best else await resolve.browse(client, namespaces, "")
    variables = [resolve.name_of(one.node, namespaces) for one in shown if one.is_variable][:SHOWN_MAX]
    pinned = session.fingerprint_of(client)
    return Looked(found, best, units.get(best, {}), variables, pinned, heard)


def _worth(name: str, found: SampleSet) -> tuple[bool, bool, int]:
    """Return which of two models to take: the one that knows the tool, the control's own, the one with more values.

    A SINUMERIK that shows a companion model as well is a SINUMERIK: only its own names lead to tools, parameters and the PLC.
    """
    there = {sample.signal for sample in found.samples if sample.value is not None or sample.reason == "empty"}
    return "tool_number" in there, maps()[name].is_native, len(there)


def _text(config: Config, device: str, looked: Looked) -> str:
    source, best = config.source, looked.best
    lines = [
        f"# Drafted from {source.url}. Compare the values of `cnctwin edge check` with the control's screen before you go on.",
        *(_model(name, one, name == best) for name, one in looked.found.items()),
        *_alarms(looked.heard),
        "",
        "[machine]",
        f"name = {_quoted(device or 'machine')}",
        'adapter = "opcua"',
        "",
        "[broker]",
        'url = "mqtt://127.0.0.1:1883"',
        "",
        "[opcua]",
        f"url = {_quoted(source.url)}",
        f"map = {_quoted(best)}" if best else 'map = ""  # no model that we know: name the nodes below',
    ]
    if source.security == "none":
        lines.append('security = "none"  # nothing is encrypted, and the server is not authenticated')
    if looked.fingerprint:
        lines.append(f"server_fingerprint = {_quoted(looked.fingerprint)}")
    if source.username:
        lines += [f"username = {_quoted(source.username)}", f"password_env = {_quoted(source.password_env)}"]
    lines += ["", *(_signals(looked.found[best], looked.units) if best else _unknown(looked.variables))]
    lines += _BY_ADDRESS if best and maps()[best].is_native else []
    return "\n".join(lines) + "\n"


def _model(name: str, found: SampleSet, is_best: bool) -> str:
    """Return what the server is found to be, or to follow besides."""
    given = sum(sample.value is not None for sample in found.samples)
    what = "It is a" if maps()[name].is_native else "It follows"
    return f"# {what} {maps()[name].title}: {given} of {len(found.offers or ())} signals{', mapped below' if is_best else ''}"


def _alarms(heard: Heard) -> list[str]:
    """Return where alarms come from, and which are there, as comments."""
    table = heard.table
    if not heard.source:
        return [f"# Alarms: {table.why_not}"]
    known = f"{len(table.alarms)} now" if not table.why_not else table.why_not
    shown = [f"#   {row.signal.removeprefix('(alarm) ')}: {row.value}" for row in alarm_rows(heard)[:SHOWN_ALARMS_MAX]]
    return [f"# Alarms: events of {heard.source}, {known}", *(_printable(line) for line in shown)]


def _printable(text: str) -> str:
    return "".join(char if char.isprintable() else " " for char in text)


def _signals(found: SampleSet, units: dict[str, str]) -> list[str]:
    """Return what the map gives, as comments; a unit that the server declares and that is not ours becomes a table."""
    values = {sample.signal: sample for sample in found.samples}
    lines = []
    for offer in found.offers or ():
        sample = values.get(offer.signal)
        shown = "not reported" if sample is None else (sample.reason or sample.value)
        native = _UNITS.get(units.get(offer.signal, "").strip(), "")
        if native and conversion(native, signal(offer.signal).unit).factor != 1.0:
            lines += [f"[signals.{offer.signal}]  # {offer.source}", f"native_unit = {_quoted(native)}"]
        else:
            unit = units.get(offer.signal, "")
            lines.append(f"# {offer.signal}: {offer.source}{f' in {unit}' if unit else ''}, now {str(shown)[:60] or EMPTY}")
    return lines


def _unknown(variables: list[str]) -> list[str]:
    head = [
        "# [signals.tool_number]",
        "# data_item = " + _quoted(variables[0] if variables else "nsu=urn:example;s=ToolNumber"),
        "#",
    ]
    return [*head, "# Variables of this server:", *(f"#   {name}" for name in variables)]


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(char if char.isprintable() else f"\\u{ord(char):04x}" for char in escaped) + '"'
