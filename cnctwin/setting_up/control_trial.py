"""The control of a machine, found and asked: a configuration of its edge, and the first values that it would publish."""

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.setting_up.toml_text import with_key
from edge.adapter import Row, find
from edge.check import check, discover
from edge.config_file import parse
from edge.errors import EdgeError
from sparkplug.shown_address import shown_address

SHOWN = ("exec_state", "program", "tool_number", "spindle_rpm", "spindle_load_pct", "spindle_temp_c", "feed_mm_min")
"""The signals whose first values are shown, in this order."""


def drafted(url: str, device: str) -> str:
    """Return a configuration of an edge, as the control at this address describes itself. Raises UsageError."""
    try:
        return discover(url, device=device)
    except EdgeError as error:
        shown = shown_address(url)
        raise UsageError(f"no control answers at {shown}: {str(error).removeprefix(f'{shown}: ')}") from None


def address_of(text: str, path: Path) -> str:
    """Return the address of the control in the file of an edge, as `edge discover` takes it."""
    config = parse(text, path)
    address = getattr(config.source, "url", None)
    if address is not None:
        return str(address)
    scheme = find(config.machine.adapter).schemes[0]
    return f"{scheme}://{config.source.host}:{config.source.port}"


def at_another_address(text: str, draft: str, path: Path) -> str:
    """Return the file of an edge for a control at another address: what the draft says of the way there, the rest as it is.

    A control of another kind has a file of its own: the draft.
    """
    there, fresh = tomllib.loads(text), tomllib.loads(draft)
    kind = fresh["machine"].get("adapter", "mtconnect")
    if there.get("machine", {}).get("adapter", "mtconnect") != kind:
        return draft
    for key, value in fresh.get(kind, {}).items():
        if isinstance(value, str | int | float | bool) and there.get(kind, {}).get(key) != value:
            text = with_key(text, kind, key, value, path)
    return text


def first_values(text: str) -> list[Row]:
    """Return the signals that an edge of this configuration would publish, asking the control. Raises UsageError."""
    with TemporaryDirectory(prefix="cnctwin-init-") as folder:
        file = Path(folder) / "edge.toml"
        file.write_text(text, encoding="utf-8")
        try:
            return check(file)
        except EdgeError as error:
            raise UsageError(str(error).replace(f"{file}: ", "")) from None


def in_words(rows: Sequence[Row]) -> Iterator[str]:
    """Yield how many signals there are, and the first values of those that people look for."""
    signals = {row.signal: row for row in rows if not row.signal.startswith("(")}
    known = sum(row.value is not None for row in signals.values())
    yield f"{len(signals)} signals, {known} of them with a value now"
    for name in SHOWN:
        if name in signals:
            row = signals[name]
            yield f"  {name:<18} {_value(row.value)} {row.unit or ''}".rstrip() + (f"  ({row.reason})" if row.reason else "")


def _value(value: Any) -> str:
    return "–" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
