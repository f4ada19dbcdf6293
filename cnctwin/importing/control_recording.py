"""Seconds from a control's own oscilloscope as a run log: which of its signals is which column, and the packets put in time.

A control calls a signal by axis and channel, `x_s_nominal`; the table below says which column a channel is. A packet that was
lost is a gap in time: nothing is put in its place.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.files.output import check_suffix
from cnctwin.importing.column_map import ColumnMap, ColumnOptions
from cnctwin.importing.recorded_files import Account, Source, own_units
from cnctwin.importing.rows import Block
from cnctwin.importing.run_columns import run_column, unit_of
from cnctwin.importing.run_writer import write_blocks
from cnctwin.importing.stamps import NS
from cnctwin.importing.units import units_for
from cnctwin.importing.values import Reader, Tally, reader
from edge.controls.heidenhain.oscilloscope import VALUES, Oscilloscope, Packet, ScopeError, ScopeSignal

CHANNELS = {
    "ref": ("s_nominal", "s_noml", "s_soll"),
    "pos": ("s_actual", "s_act", "s_ist"),
    "torque": ("i_nominal", "i_noml", "i_soll", "m_actual", "m_act", "m_ist"),
}
"""Role of an axis signal → the channels that tell it, best first, in English and German."""
ROTARY = "abc"
VALUES_MAX = 60_000_000
SPACING = 0.05
"""Share by which the time that packets took may differ from the time that their values cover."""


class Wanted(NamedTuple):
    """A signal that is recorded, and the column that it becomes."""

    signal: ScopeSignal
    column: str
    options: ColumnOptions


def wanted(offered: Sequence[ScopeSignal], names: Sequence[str], chosen: ColumnMap | None) -> list[Wanted]:
    """Return the signals that are asked for: by the control's name, by `x_ref`, `x_pos`, `x_torque`, or by the map.

    Raises UsageError, with the signals that there are, for one that is not there.
    """
    by_name = {signal.name: signal for signal in offered}
    found: dict[str, Wanted] = {}
    by_map = {} if chosen is None else chosen.by_column()
    asked = [*names, *(() if names else (options.source for options in by_map.values()))]
    for name in asked:
        signal = by_name.get(name) or _by_role(name, by_name)
        if signal is None:
            raise UsageError(f"--signals {name}: the control has no such signal; it has {', '.join(by_name)}")
        mapped = next(((column, one) for column, one in by_map.items() if one.source in {name, signal.name}), None)
        column = mapped[0] if mapped else column_of(signal)
        if column is None:
            raise UsageError(
                f'--signals {name}: no column of a run log is known for it; name one in --map: from = "{signal.name}"'
            )
        if column in found:
            raise UsageError(f"--signals {name}: {column} comes from {found[column].signal.name} already; name one of them")
        options = mapped[1] if mapped else ColumnOptions.model_validate({"from": signal.name})
        found[column] = Wanted(signal, column, options)
    if not found:
        raise UsageError(f"--signals names none; the control has {', '.join(by_name)}")
    return list(found.values())


def column_of(signal: ScopeSignal) -> str | None:
    """Return the column of a run log that a signal of the control is; None where none is known."""
    axis, _, channel = signal.name.partition("_")
    role = next((role for role, channels in CHANNELS.items() if channel in channels), None)
    if role is None or not signal.label:
        return None
    return run_column(f"{axis}_torque_a" if role == "torque" else f"{axis}_{role}_{'deg' if axis in ROTARY else 'mm'}")


def _by_role(name: str, by_name: dict[str, ScopeSignal]) -> ScopeSignal | None:
    axis, _, role = name.removesuffix("_mm").removesuffix("_deg").removesuffix("_a").partition("_")
    return next((by_name[f"{axis}_{one}"] for one in CHANNELS.get(role, ()) if f"{axis}_{one}" in by_name), None)


def record(
    scope: Oscilloscope,
    signals: Sequence[Wanted],
    seconds: float,
    interval_us: int,
    out: Path,
    *,
    is_over: Callable[[], bool] = lambda: False,
    progress: Callable[[float], None] = lambda _: None,
    clock: Callable[[], float] = time.monotonic,
) -> Account:
    """Record for so long, or until it is over, and write the run log of what came. Raises UsageError, ScopeError."""
    check_suffix(out)
    if seconds * 1e6 / interval_us * len(signals) > VALUES_MAX:
        raise UsageError(f"--seconds {seconds:g} with {len(signals)} signals is more than {VALUES_MAX} values; record in parts")
    chosen = [one.signal for one in signals]
    units = scope.select(chosen, interval_us)
    readers = [_reader(one, unit) for one, unit in zip(signals, units, strict=True)]
    packets: list[Packet] = []
    remarks: list[str] = []
    packets_max = int(np.ceil(seconds * 1e6 / interval_us / VALUES))
    came_s: list[float] = []
    try:
        for packet in scope.packets(chosen, interval_us):
            packets.append(packet)
            came_s.append(clock())
            covered_s = (len(packets)) * VALUES * interval_us / 1e6
            progress(covered_s)
            if len(packets) >= packets_max or is_over():
                break
    except ScopeError as error:
        if not packets:
            raise
        remarks.append(f"{error}; what came before it is kept")
    if len(packets) < packets_max and not remarks:
        remarks.append(f"ended after {covered_s:.3g} of {seconds:g} s; what came is kept")
    index, lost = packet_times([packet.number for packet in packets])
    if lost:
        remarks.append(f"{lost} of {lost + len(packets)} packets were lost on the way: each is a gap of {VALUES} rows")
    remarks += _spacing(came_s, index, interval_us)
    tallies = {one.column: Tally() for one in signals}
    written = write_blocks(_blocks(packets, index, readers, interval_us, tallies), [one.column for one in signals], out)
    columns = {
        one.column: Source(
            one.signal.name, found.options.unit or unit, found.convert.scale * one.options.scale, one.options.offset
        )
        for one, found, unit in zip(signals, readers, units, strict=True)
    }
    return Account(
        files={scope.control: "oscilloscope"},
        rows={scope.control: len(packets) * VALUES},
        columns=columns,
        tallies=tallies,
        left_out=(),
        faults={},
        remarks=(*remarks, *own_units(columns)),
        written=written,
    )


def packet_times(numbers: Sequence[int]) -> tuple[list[int], int]:
    """Return the place of each packet, counted from the first, and how many are missing between them.

    >>> packet_times([7, 8, 11]), packet_times([32, 64, 96]), packet_times([3, 3, 2])
    (([0, 1, 4], 2), ([0, 1, 2], 0), ([0, 1, 2], 0))
    """
    steps = [later - earlier for earlier, later in pairwise(numbers)]
    if not steps or min(steps) <= 0:  # it does not count
        return list(range(len(numbers))), 0
    unit = min(steps)
    index = [0]
    for step in steps:
        index.append(index[-1] + max(1, round(step / unit)))
    return index, index[-1] + 1 - len(index)


def _spacing(came_s: Sequence[float], index: Sequence[int], interval_us: int) -> Iterator[str]:
    """Say where packets came in another time than that of their values."""
    if len(index) < 20:
        return
    took_s, covers_s = came_s[-1] - came_s[0], index[-1] * VALUES * interval_us / 1e6
    if abs(took_s - covers_s) > SPACING * covers_s:
        yield (
            f"{covers_s:.3g} s of values came in {took_s:.3g} s: the control may not space them by {interval_us} µs as asked; "
            "compare a motion of known length"
        )


def _reader(one: Wanted, unit: str) -> Reader:
    found = reader(one.column, one.options, unit, ".", ())
    if found is None:
        there_are = units_for(unit_of(one.column))
        raise UsageError(
            f"{one.signal.name} is in {unit!r}, which does not become {one.column}; name a unit in --map: {there_are}"
        )
    return found


def _blocks(
    packets: Sequence[Packet], index: Sequence[int], readers: Sequence[Reader], interval_us: int, tallies: dict[str, Tally]
) -> Iterator[Block]:
    rows = np.arange(VALUES, dtype=np.int64)
    for begin in range(0, len(packets), 512):
        part = packets[begin : begin + 512]
        ticks: NDArray[np.int64] = np.concatenate([place * VALUES + rows for place in index[begin : begin + 512]])
        columns = {
            one.column: one.scaled(np.concatenate([packet.values[at] for packet in part]), tallies[one.column])
            for at, one in enumerate(readers)
        }
        yield Block(ticks * interval_us * (NS // 1_000_000), columns, False)
