"""A first configuration for the FANUC control at an address."""

from urllib.parse import urlsplit

from pydantic import ValidationError

from edge.config import EdgeConfig
from edge.controls.focas.check import look
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.mapping import FocasMapping
from edge.errors import ConfigError
from edge.sample import SampleSet
from edge.sweep import Sweep
from edge.tool_change import CUE
from sparkplug.shown_address import shown_address

PORT = 8193
CHOSEN_LINES = (
    "# What this machine keeps in variables and in its PMC, under names of your own (docs/how-to/edge-focas.md):",
    "# [variables]",
    '# part_width = { address = "#500", unit = "mm" }',
    "# [plc]",
    '# door_open = { address = "R100.3", kind = "flag" }',
    "",
)


def draft(url: str, device: str = "") -> str:
    """A configuration for the control at `focas://host:8193`, as text. `device` is the machine's name."""
    config = EdgeConfig(source=_source(url))
    sweep, frame = look(config)
    return text_of(config.source, device, sweep, frame)


def _source(url: str) -> FocasConfig:
    fault = ConfigError(
        f"address {shown_address(repr(url))} is no address of a FANUC control; write it as focas://192.168.1.10:{PORT}"
    )
    try:
        parts = urlsplit(url)
        port = parts.port or PORT
    except ValueError:
        raise fault from None
    if parts.scheme != "focas" or not parts.hostname or "@" in parts.netloc or parts.path.strip("/") or parts.query:
        raise fault
    try:
        return FocasConfig(host=parts.hostname, port=port)
    except ValidationError as error:
        raise ConfigError(f"address {shown_address(repr(url))}: {error.errors()[0]['msg']}") from None


def text_of(source: FocasConfig, device: str, sweep: Sweep, frame: SampleSet) -> str:
    """The configuration, with what the control says of itself as comments."""
    told = {fact.key.removeprefix("control."): str(fact.value) for fact in sweep.facts if fact.key.startswith("control.")}
    nulls = {sample.signal: sample.reason or "" for sample in frame.samples if sample.value is None}
    signals = [offer.signal for offer in frame.offers or () if offer.signal not in nulls]
    lines = [
        f"# Drafted from focas://{source.host}:{source.port}. Values that are not here have their defaults; "
        "see edge/edge.toml and edge/controls/focas/focas.toml.",
        _comment(f"{told['cnc_type']}i-{told['mt_type']} series {told['series']} version {told['version']}, axes {told['axes']}"),
        "",
        "[machine]",
        f"name = {_quoted(_topic_word(device or 'machine'))}",
        'adapter = "focas"',
        "",
        "[broker]",
        'url = "mqtt://127.0.0.1:1883"',
        "",
        "[focas]",
        f"host = {_quoted(source.host)}",
        f"port = {source.port}",
        'backend = "ethernet"  # experimental; with your own library: backend = "library" and library = "/path/of/libfwlib32.so"',
        'tool_change_pmc = ""  # a bit that is on during a tool change, if the builder\'s ladder has one, such as "R100.3"',
        "",
        *CHOSEN_LINES,
        "# Published:",
        *(_comment(f"  {name}") for name in signals),
        "# Null now, and why:",
        *(_null_lines(source, sweep, nulls) or ["#   nothing"]),
    ]
    return "\n".join(lines) + "\n"


def _null_lines(source: FocasConfig, sweep: Sweep, nulls: dict[str, str]) -> list[str]:
    """Return a line for each reason with the signals that are null for it, and for what is refused and feeds none."""
    mapping = FocasMapping(source, ())
    unfed = {fact.key: fact.fault for fact in sweep.facts if fact.fault and mapping.target(fact.key) is None}
    why = {name: reason for name, reason in (nulls | unfed).items() if name != CUE}
    return [
        _comment(f"  {', '.join(name for name, one in why.items() if one == reason)}: {reason}")
        for reason in dict.fromkeys(why.values())
    ]


def _comment(text: str) -> str:
    return _one_line(f"# {text}")


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def _topic_word(name: str) -> str:
    return "".join("-" if c in "/+#" or c.isspace() else c for c in name)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
