"""docs/reference/signals.md: the canonical signals, from twin/vocabulary/signals.py."""

from twin.vocabulary.signals import AXES, CHOSEN, CHOSEN_NAME, SIGNALS, Signal

HEAD = """\
# Signals

For whoever reads values from the broker. Each control says the same things in its own words and units; an edge translates them to these canonical signals: one name, one unit, one
meaning. A number outside its range is null with quality BAD and keeps the figure in the reason
([edge-mtconnect.md](../how-to/edge-mtconnect.md)); a text outside its words is null with the word as reason. A signal that a control does
not offer is not published. `<axis>` is a letter, with a digit where a control has several of one letter: `axis_z4_pos_mm`.
`<name>` is a name of up to 32 lower-case letters, digits and underscores that the tables `[variables]` and `[plc]` of an edge's
configuration give to an address ([edges.md](../how-to/edges.md)). The signals of a tool are about the one in the spindle, and they rest on the control's own
tables and counts: nothing is computed.

An entry of `alarms` and `alarm_history` has null where the control does not tell. Severity is the control's own: a word (`fault`), or a number (1 to
1,000 of OPC UA). `since` is ISO 8601: in UTC with a Z, without one as the control's own calendar shows it.

This page is written by `scripts/reference` from [`twin/vocabulary/signals.py`](../../twin/vocabulary/signals.py). What the twin adds,
below `twin/`, is in [processors.md](processors.md).

| signal | unit | range | meaning |
|---|---|---|---|
"""


def page() -> str:
    """Return the table of canonical signals."""
    axes = {f"axis_<axis>_{pattern.pattern.rpartition('}_')[2]}": signal for pattern, signal in AXES}
    chosen = {pattern.pattern.removesuffix(CHOSEN_NAME) + "<name>": signal for pattern, signal in CHOSEN}
    return HEAD + "".join(_row(name, signal) for name, signal in {**SIGNALS, **axes, **chosen}.items())


def _row(name: str, signal: Signal) -> str:
    limits = "" if signal.low is None else f"{signal.low:,g} to {signal.high:,g}".replace("-", "−")
    shown = limits or ", ".join(sorted(signal.words)) or signal.kind.value
    return f"| `{name}` | {signal.unit} | {shown} | {signal.meaning} |\n"
