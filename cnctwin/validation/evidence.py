"""The evidence of a night: what the machine told, what the twin said, and what somebody else has measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Column, Query, Store
from cnctwin.validation.clock import Clock, Pair, placed
from cnctwin.validation.track import Floats, Track
from sparkplug.quality import Quality
from twin.runlog import RunLog
from twin.vocabulary import twin_signals

TEMPERATURE, AMBIENT, SPEED, LOAD = "spindle_temp_c", "ambient_temp_c", "spindle_rpm", "spindle_load_pct"
VIBRATION, COOLANT, TOOL = "vibration_rms_g", "coolant_on", "tool_number"
MODELLED, FORCE, SHAKEN = twin_signals.SPINDLE_TEMP_C, twin_signals.CUTTING_FORCE_N, twin_signals.VIBRATION_RMS_G
RESULTANT = "resultant_n"
SLOW_MS, FAST_MS = 10_000, 1_000
SLOW = (TEMPERATURE, AMBIENT, MODELLED)
FAST = (SPEED, LOAD, VIBRATION, COOLANT, TOOL, FORCE, SHAKEN)
ABSOLUTE_S = 1e9
"""Times beyond it count from 1970: a run is not thirty years long."""
STORE_EVERY_S, RUN_EVERY_S = 1.0, 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """One stretch of one machine.

    name: of the stretch; source: where it is from; told, twin: signal → what was told; twin ones are as published
    run: where it is a run log, which may hold what no store has; truth: signal → what somebody else measured, on our clock
    """

    name: str
    machine: str
    from_s: float
    to_s: float
    source: str
    told: Mapping[str, Track]
    twin: Mapping[str, Track] = field(default_factory=dict)
    run: RunLog | None = None
    truth: Mapping[str, Track] = field(default_factory=dict)
    clock: Clock | None = None
    truth_reason: str | None = None

    def knows(self, *names: str) -> bool:
        """Return True if the machine told each of these."""
        return all(name in self.told and self.told[name].is_known for name in names)


def of_store(store: Store, machine: str, from_ms: int, to_ms: int, source: str) -> Evidence:
    """A stretch of a store. Raises UsageError where the machine is not in it."""
    if machine not in (there := store.machines()):
        raise UsageError(f"{source}: holds no machine {machine}; there are {', '.join(there[:20]) or 'none'}")
    tracks: dict[str, Track] = {}
    for names, every_ms in ((SLOW, SLOW_MS), (FAST, FAST_MS)):
        for column in store.query(Query(machine, names, from_ms, to_ms, every_ms)):
            tracks[column.signal] = track_of(column, every_ms / 1000.0)
    twin = {name: track for name, track in tracks.items() if name.startswith(twin_signals.TWIN_PREFIX)}
    told = {name: track for name, track in tracks.items() if name not in twin}
    return Evidence(source, machine, from_ms / 1000.0, to_ms / 1000.0, source, told, twin)


def track_of(column: Column, every_s: float = 0.0) -> Track:
    """Numbers of a column; a value that is not good is not known. Of windows, as of their middle."""
    good = [
        float(value) if isinstance(value, (int, float)) and (every_s or quality is Quality.GOOD) else np.nan
        for value, quality in zip(column.value, column.quality, strict=True)
    ]
    return Track(np.array(column.t_us, dtype=np.float64) / 1e6 + 0.5 * every_s, np.array(good, dtype=np.float64))


def of_run(log: RunLog, machine: str) -> Evidence:
    """A run log; a column that has no sample in a row was not told there."""
    told = {
        name: Track(log.t_s[there], values[there]) for name, values in log.columns.items() if (there := np.isfinite(values)).any()
    }
    return Evidence(Path(log.source).name, machine, float(log.t_s[0]), float(log.t_s[-1]), log.source, told, {}, log)


def with_truth(evidence: Evidence, truth: RunLog, offset_s_max: float) -> Evidence:
    """The evidence with what a truth file holds, put on the machine's clock; or with the reason why it cannot be."""
    seen = truth_tracks(truth)
    if not seen:
        raise UsageError(
            f"{truth.source}: holds none of {TEMPERATURE}, force_x_n with force_y_n, {VIBRATION}: it is no ground truth"
        )
    every_s = STORE_EVERY_S if evidence.run is None else RUN_EVERY_S
    pairs = [
        Pair(by, seen[one], other)
        for by, one, other in _alike(evidence)
        if one in seen and seen[one].is_known and other is not None and other.is_known
    ]
    first_s, last_s = float(truth.t_s[0]), float(truth.t_s[-1])
    if (first_s > ABSOLUTE_S) is (evidence.from_s > ABSOLUTE_S):
        reach_s = (-offset_s_max, offset_s_max) if first_s > ABSOLUTE_S else (-last_s, evidence.to_s - evidence.from_s)
    else:
        reach_s = (evidence.from_s - last_s, evidence.to_s - first_s)
    clock = placed(pairs, evidence.from_s, evidence.to_s, every_s, reach_s)
    if isinstance(clock, str):
        return replace(evidence, truth_reason=f"{Path(truth.source).name}: {clock}")
    return replace(evidence, clock=clock, truth={name: track.moved(clock.offset_s) for name, track in seen.items()})


def truth_tracks(truth: RunLog) -> dict[str, Track]:
    """Return the signals of a truth file; the resultant of a dynamometer beside its axes."""
    tracks = dict(of_run(truth, "").told)
    both = resultant_of(truth)
    if both is not None:
        tracks[RESULTANT] = both
    measured = {TEMPERATURE, RESULTANT, VIBRATION}
    return tracks if measured & set(tracks) else {}


def resultant_of(log: RunLog) -> Track | None:
    """The force across the tool, √(F_x² + F_y²), where both were measured."""
    if not log.has("force_x_n", "force_y_n"):
        return None
    size: NDArray[np.float64] = np.hypot(log["force_x_n"], log["force_y_n"])
    there = np.isfinite(size)
    return Track(log.t_s[there], size[there])


def _alike(evidence: Evidence) -> Sequence[tuple[str, str, Track | None]]:
    """Return what the truth may have seen, beside what the machine or its twin tells of the same."""
    told, twin = evidence.told, evidence.twin
    own = None if evidence.run is None else resultant_of(evidence.run)
    return (
        ("spindle speed", SPEED, told.get(SPEED)),
        ("spindle load", LOAD, told.get(LOAD)),
        ("force", RESULTANT, own),
        ("force beside the twin's", RESULTANT, twin.get(FORCE)),
        ("force beside spindle load", RESULTANT, told.get(LOAD)),
        ("vibration", VIBRATION, told.get(VIBRATION)),
        ("vibration beside the twin's", VIBRATION, twin.get(SHAKEN)),
        ("spindle temperature", TEMPERATURE, told.get(TEMPERATURE)),
        ("spindle temperature beside the twin's", TEMPERATURE, twin.get(MODELLED)),
    )


def flags(values: Floats) -> Floats:
    """0 and 1, what is not known as 0."""
    return np.nan_to_num(values)
