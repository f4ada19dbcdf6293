"""A first configuration from what an agent says of itself (/probe)."""

from pydantic import ValidationError

from edge.config import EdgeConfig
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import fetch
from edge.controls.mtconnect.cursor import Request, choose_device
from edge.controls.mtconnect.documents import DevicesDocument, parse_document
from edge.controls.mtconnect.mapping import assign
from edge.controls.mtconnect.model import DataItem, DeviceModel
from edge.errors import ConfigError, ConnectionLostError, DocumentError
from edge.sample import Offer
from edge.signals import signal
from sparkplug.shown_address import shown_address


def draft(url: str, device: str = "") -> str:
    """A configuration for the agent at this address, as text. Of several devices `device` names one; else it is the first."""
    try:
        config = EdgeConfig(source=MtconnectConfig(url=url))
    except ValidationError as error:
        why = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ConfigError(f"address {shown_address(repr(url))} {why}, such as http://agent:5000") from None
    try:
        document = parse_document(fetch(config, Request("/probe")))
    except DocumentError as error:
        raise ConnectionLostError(f"{url}/probe: {error}; is this the address of an MTConnect agent?") from error
    if not isinstance(document, DevicesDocument):
        raise ConnectionLostError(f"{url}/probe: the agent answers {document} in place of its device description")
    machines = [d for d in document.devices if not d.is_agent]
    wanted = device or (machines[0].name or machines[0].uuid if machines else "")
    return text_of(url, choose_device(machines, wanted), machines)


def text_of(url: str, device: DeviceModel, machines: list[DeviceModel]) -> str:
    """The configuration, with what was found as tables and what was not as comments."""
    assignment = assign(device, {})
    name = device.name or device.uuid
    others = _one_line(", ".join(d.name or d.uuid for d in machines if d is not device))
    spindles = _one_line(", ".join(assignment.spindles))
    lines = [
        f"# Drafted from {url}/probe. Values that are not here have their defaults; "
        "see edge/edge.toml and edge/controls/mtconnect/mtconnect.toml.",
        "",
        "[machine]",
        f"name = {_quoted(_topic_word(name))}",
        'adapter = "mtconnect"',
        "",
        "[broker]",
        'url = "mqtt://127.0.0.1:1883"',
        "",
        "[mtconnect]",
        f"url = {_quoted(url)}",
        f"device = {_quoted(name)}" + (f"  # the agent also has {others}" if others else ""),
    ]
    if assignment.spindle:
        lines.append(f"spindle = {_quoted(assignment.spindle)}" + (f"  # of {spindles}" if len(assignment.spindles) > 1 else ""))
    for offer in assignment.offers:
        lines += _table(offer)
    if not {offer.signal for offer in assignment.offers} & {"tool_number", "nc_block"}:
        lines += ["", "# No tool number and no block text: tool_change_active will be null."]
    if any(item.type == "TOOL_ASSET_ID" for item in device.items):
        lines += ["", "# Life, length and radius of the tool in the spindle come from its asset."]
    lines += [
        "",
        "# Data items without a canonical signal. Add one by a table [signals.<name>] with its data_item, or name one:",
        "# [variables]",
        '# part_width = { address = "id or name, or id[key] of a data set", unit = "mm" }',
    ]
    lines += [_comment(item) for item in assignment.unmapped] or ["# none"]
    return "\n".join(lines) + "\n"


def _table(offer: Offer) -> list[str]:
    unit = signal(offer.signal).unit
    lines = ["", f"[signals.{offer.signal}]" + (f"  # {unit}" if unit else ""), f"data_item = {_quoted(offer.source)}"]
    if offer.native_unit:
        lines.append(f"native_unit = {_quoted(offer.native_unit)}")
    return lines


def _comment(item: DataItem) -> str:
    words = " ".join(
        filter(None, (item.category, item.type, item.sub_type, item.units or item.native_units, item.component_name))
    )
    return _one_line(f"#   {item.label}  ({words})")


def _topic_word(name: str) -> str:
    """A Sparkplug id must not hold the characters that mean something in a topic."""
    return "".join("-" if c in "/+#" or c.isspace() else c for c in name) or "machine"


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def _quoted(text: str) -> str:
    escaped = "".join(f"\\u{ord(c):04x}" if not c.isprintable() else c for c in text.replace("\\", "\\\\").replace('"', '\\"'))
    return f'"{escaped}"'
