"""A first configuration from one look at a control."""

from pydantic import ValidationError

from edge.config import EdgeConfig
from edge.controls.heidenhain.check import first_look, looked_at_frame
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.errors import ConfigError
from edge.sample import EMPTY
from edge.sweep import Sweep
from sparkplug.shown_address import shown_address

QUARTER_MS = 900_000


def draft(url: str, device: str = "") -> str:
    """A configuration for the control at this address, as text; `device` is what the machine is to be called."""
    try:
        config = EdgeConfig(source=HeidenhainConfig(url=url))
    except ValidationError as error:
        why = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ConfigError(f"address {shown_address(repr(url))} {why}") from None
    frame = first_look(config)
    sweep = Sweep.decode(frame)
    offers, last = looked_at_frame(config, frame)
    control = next((str(fact.value) for fact in sweep.facts if fact.key == "control"), "")
    lines = [
        f"# Drafted from {url}, which calls itself {_one_line(control)}.",
        "# Values that are not here have their defaults; see edge/edge.toml and edge/controls/heidenhain/heidenhain.toml.",
        "",
        "[machine]",
        f'name = "{_topic_word(device or control.split(" ")[0])}"',
        'adapter = "heidenhain"',
        "",
        "[broker]",
        'url = "mqtt://127.0.0.1:1883"',
        "",
        "[heidenhain]",
        f'url = "{url}"',
        f"# tool_table = '{_tool_table(control)}'  # length, radius, wear and age of the tool (docs/how-to/edge-heidenhain.md)",
        *_clock_lines(sweep),
        "",
        "# Told by the control:",
    ]
    told = [offer for offer in offers if last[offer.signal].value is not None]
    silent = [offer for offer in offers if last[offer.signal].value is None]
    lines += [
        f"#   {offer.signal} = {_one_line(str(last[offer.signal].value))[:80] or EMPTY}  ({offer.source})" for offer in told
    ]
    lines += ["# Not told now, and why:"]
    lines += [f"#   {offer.signal}: {_one_line(last[offer.signal].reason or '')[:120]}" for offer in silent] or ["#   none"]
    lines += [
        "",
        "# The addresses are the machine builder's: ask for the PLC lists (docs/how-to/edge-heidenhain.md).",
        "# [heidenhain.plc]",
        '# tool_number = "W1000"',
        '# tool_change = "M4000"       # 1 while a tool change is in progress',
        '# spindle_rpm = "D1004"',
        '# spindle_load_pct = "W1008"  # with [signals.spindle_load_pct] scale = 0.1 where it counts tenths',
    ]
    return "\n".join(lines) + "\n"


def _tool_table(control: str) -> str:
    """The usual path of the tool table, by what the control calls itself."""
    return "TNC:\\TOOL.T" if control.startswith("iTNC") else "TNC:\\table\\tool.t"


def _clock_lines(sweep: Sweep) -> list[str]:
    """A clock that is wrong by whole quarters of an hour shows the local time."""
    if sweep.clock is None:
        return ["clock_interval_s = 0  # the control does not tell its time"]
    ahead_ms = sweep.clock.control_ms - sweep.clock.edge_ms
    quarters = round(ahead_ms / QUARTER_MS)
    if not quarters or abs(quarters) > 56 or abs(ahead_ms - quarters * QUARTER_MS) > 120_000:
        return []
    return [f"clock_utc_offset_h = {quarters / 4:g}  # the control counts in local time"]


def _topic_word(name: str) -> str:
    """A Sparkplug id must not hold the characters that mean something in a topic."""
    return "".join(c if c.isalnum() or c in "-_." else "-" for c in name) or "machine"


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
