"""The executions of programs in a store, or the one in a run log."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cnctwin.memory.store.contract import Column, Query, Store
from cnctwin.validation.cycle_time import Cycle
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.runlog import RunLog, run_log
from twin.vocabulary.signals import OVERRIDES

STATE, PROGRAM, LINE = "exec_state", "program", "nc_line"
TOLD = (LINE, "feed_mm_min", "tool_number")
BEGUN_AFTER = (None, "READY", "PROGRAM_COMPLETED")
CYCLES_MAX = 200
"""The cycles of a night that are judged; the first ones."""
CYCLE_S_MAX = 8 * 3600


def cycles_of(store: Store, machine: str, from_ms: int, to_ms: int) -> tuple[list[Cycle], str]:
    """The cycles that began and ended in a stretch; why there are none."""
    columns = {c.signal: c for c in store.query(Query(machine, (STATE, PROGRAM, *OVERRIDES), from_ms, to_ms))}
    if not columns[STATE].value:
        return [], f"{STATE} is not recorded, which tells when a program begins and ends"
    spans = list(_spans(columns[STATE]))[:CYCLES_MAX]
    cycles = [
        Cycle(str(_at(columns[PROGRAM], begin) or "unnamed"), log)
        for begin, end in spans
        if end - begin <= CYCLE_S_MAX * 1_000_000 and (log := _log(store, machine, begin, end, columns)) is not None
    ]
    if spans and not cycles:
        return [], f"{LINE} is not recorded, so that nothing says what was executed when"
    return cycles, "no program was run from its beginning to its end"


def cycle_of_run(log: RunLog) -> tuple[list[Cycle], str]:
    """The run, where it has lines: named after its program, else after its file."""
    if not log.has("line"):
        return [], "the run has no column line, so that nothing says what was executed when"
    named = [str(name) for name in log.text.get("program", ()) if name]
    return [Cycle(named[0] if named else Path(log.source).stem, log)], ""


def _spans(states: Column) -> Iterator[tuple[int, int]]:
    """Begin and end, µs, of executions that were completed."""
    before: Value = None
    begun: int | None = None
    for at, state, quality in zip(states.t_us, states.value, states.quality, strict=True):
        if quality is not Quality.GOOD:
            begun, before = None, ""
            continue
        if state == "ACTIVE" and before in BEGUN_AFTER:
            begun = at
        elif state in ("PROGRAM_COMPLETED", "READY") and begun is not None:
            if at > begun and (state == "PROGRAM_COMPLETED" or before == "ACTIVE"):  # READY after a stop is a reset
                yield begun, at
            begun = None
        before = state


def _at(column: Column, at_us: int) -> Value:
    """Return what was told last until a moment, or first after it."""
    place = max(int(np.searchsorted(np.array(column.t_us, dtype=np.int64), at_us, side="right")) - 1, 0)
    return column.value[place] if column.value else None


def _log(store: Store, machine: str, begin_us: int, end_us: int, night: dict[str, Column]) -> RunLog | None:
    """One execution as a run log of kind `program`; None where the control did not tell its lines."""
    columns = store.query(Query(machine, TOLD, begin_us // 1000, end_us // 1000 + 1))
    if not columns[0].t_us:
        return None
    stamps = np.unique(np.concatenate([np.array(c.t_us, dtype=np.int64) for c in columns] + [np.array([begin_us, end_us])]))
    stamps = stamps[(stamps >= begin_us) & (stamps <= end_us)]
    numbers: dict[str, NDArray[np.generic]] = {"t_s": (stamps - begin_us) / 1e6}
    for column in (*columns, *(night[name] for name in OVERRIDES)):
        if column.t_us:
            numbers["line" if column.signal == LINE else column.signal] = _held(column, stamps)
    state = night[STATE]
    texts = [_at(state, int(stamp)) for stamp in stamps.tolist()]
    texts[-1] = "PROGRAM_COMPLETED"  # READY after ACTIVE is the end as well, on controls that tell no other
    numbers["exec_state"] = np.array(texts, dtype=object)
    return run_log(numbers, f"{machine} {begin_us // 1000}")


def _held(column: Column, stamps: NDArray[np.int64]) -> NDArray[np.float64]:
    told = np.array([float(v) if isinstance(v, (int, float)) else np.nan for v in column.value], dtype=np.float64)
    place = np.searchsorted(np.array(column.t_us, dtype=np.int64), stamps, side="right") - 1
    return np.where(place >= 0, told[np.maximum(place, 0)], np.nan)


def names_of(cycles: Sequence[Cycle]) -> list[str]:
    """Return the names of the programs that ran."""
    return sorted({cycle.program for cycle in cycles})
