#!/usr/bin/env python3
"""A day of a real machine: its heat from the store to a case, a diagnosis, and what a live twin gains on the part not fitted.

    .venv/bin/python benchmarks/gap/mazak.py [--machine Mazak01 | Mazak03] [--ambient-c 22]

Recordings: raw logs of the NIST Smart Manufacturing Systems Test Bed (CNCTWIN_DATA or ../shared/data). Each holds a single day,
and none tells the surroundings: their temperature is assumed throughout. The description is the assumed one, since nobody has
stated any. The live twin is the processor thermal, folded over the part to judge on: started at the reading of its beginning,
then driven by speed and load alone; it starts again where the agent said UNAVAILABLE for longer than `gap_s_max`. The same is
done with surroundings at the level of the standing spindle: they are open, and nothing that rests on 22 °C is known.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.programs.plates import data_folder
from cnctwin.composing.assumed import assumed_description
from cnctwin.composing.compose import compose
from cnctwin.importing.into_store import import_recording
from cnctwin.memory.store.opening import open_store
from processors.contract import Sample, SampleKind
from processors.description import Description
from processors.thermal import Config, State, described, step
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.case import Case, RunKind, read_case
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis
from twin.identification.identify import identify
from twin.machine_toml import machine_to_toml
from twin.runlog import RunLog
from twin.vocabulary.twin_signals import SPINDLE_TEMP_C

RECORDINGS = {"Mazak01": "Mazak01-20180718-20180719.txt", "Mazak03": "Mazak03-20170629-20170630.txt"}
INPUTS = ("spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c")
TICK_S = 10.0


@dataclass(frozen=True, slots=True)
class Live:
    """The error of a live twin over a run, K: rms and largest difference from the reading."""

    rms_k: float
    worst_k: float


def live_of(description: str, log: RunLog) -> Live:
    """Return how the thermal processor with this description followed a run."""
    given = described(Config(), Description.from_toml(description))
    state, apart = State(), []
    for sample in _samples(log):
        state, outputs = step(given, state, sample)
        shown = next((one.value for one in outputs if one.name == SPINDLE_TEMP_C), None)
        read, _ = sample.number("spindle_temp_c")
        if isinstance(shown, float) and read is not None:
            apart.append(shown - read)
    return Live(float(np.sqrt(np.mean(np.square(apart)))), float(np.max(np.abs(apart))))


def _samples(log: RunLog) -> Iterator[Sample]:
    """Yield what was told last and a tick every ten seconds, from the first row on that tells all of it."""
    told = np.all([np.isfinite(log[name]) for name in INPUTS], axis=0)
    for at_s in np.arange(float(log.t_s[told][0]), float(log.t_s[-1]), TICK_S).tolist():
        row = int(np.searchsorted(log.t_s, at_s, side="right")) - 1
        values = {name: float(log[name][row]) for name in INPUTS}
        known = {name: value for name, value in values.items() if np.isfinite(value)}
        readings = {
            name: Reading(name, value, int(1000 * at_s), Quality.GOOD, None, None, False) for name, value in known.items()
        }
        yield Sample("mazak", SampleKind.DATA, at_s, readings, INPUTS)
        yield Sample("mazak", SampleKind.TICK, at_s, readings)


def show_runs(case: Case) -> None:
    """Print what was composed: the temperature, and how much the spindle turned."""
    for run in case.of(RunKind.WARMUP):
        log = run.log
        read, turning = log["spindle_temp_c"], np.abs(log["spindle_rpm"]) > 100.0
        stands = float(np.diff(log.t_s, append=log.t_s[-1])[~turning].sum() / log.t_s[-1])
        span = f"{np.nanmin(read):.0f} to {np.nanmax(read):.0f} °C"
        print(f"  {run.entry.role:5} {run.name}: {log.t_s[-1] / 60:.0f} min, {span}, {100 * stands:.0f} % of it at rest")


def show(d: Diagnosis) -> None:
    """Print a diagnosis."""
    print(f"{d.verdict.value}: {d.sentence}")
    for cause in d.causes:
        figures = ", ".join(f"{n} {v.value:.3g} ({v.low:.3g} to {v.high:.3g})" for n, v in cause.parameters.items())
        rivals = ", ".join(f"{r.effect} on {r.on}" if r.on else r.effect for r in cause.indistinguishable_from)
        print(f"  {cause.effect} on {cause.on or 'the machine'}: {figures}; not told from: {rivals or 'nothing'}")
    for term in d.learned:
        print(f"  described: {term.sentence}")
    print(f"  not identifiable: {', '.join(d.not_identifiable) or 'nothing'}")


def level_c(case: Case) -> float:
    """Return the temperature that the standing spindle has in the fitted runs: the surroundings, were they left open."""
    logs = [run.log for run in case.of(RunKind.WARMUP, "fit")]
    return float(np.nanmedian(np.concatenate([log["spindle_temp_c"][log["spindle_rpm"] == 0.0] for log in logs])))


def show_case(case: Case, assumed: str) -> None:
    """Print the diagnosis of a case, and how live twins follow the part that was not fitted."""
    show_runs(case)
    found = diagnose(case)
    show(found.diagnosis)
    twins = {"identified": machine_to_toml(identify(case).machine), "diagnosed": machine_to_toml(found.twin)}
    for run in case.of(RunKind.WARMUP, "check"):
        print(f"live on {run.name}")
        for name, text in {"assumed": assumed, **twins}.items():
            live = live_of(text, run.log)
            print(f"  {name:10} rms {live.rms_k:.2f} K, at most {live.worst_k:.2f} K")
        read = run.log["spindle_temp_c"]
        apart = read[np.isfinite(read)] - read[np.isfinite(read)][0]
        print(f"  {'its start':10} rms {np.sqrt(np.mean(apart**2)):.2f} K, at most {np.abs(apart).max():.2f} K: no twin at all")


def main() -> None:
    """Print the day."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machine", choices=RECORDINGS, default="Mazak01")
    parser.add_argument("--ambient-c", type=float, default=22.0, help="the surroundings that are assumed first")
    options = parser.parse_args()
    nist, name = data_folder() / "nist", options.machine
    assumed = assumed_description(name)
    with tempfile.TemporaryDirectory() as made:
        store = open_store(Path(made) / "store", writable=True)
        try:
            import_recording(store, nist / "raw" / RECORDINGS[name], nist / "devices.xml", name)
            first = compose(store, name, assumed, Path(made) / "assumed", ambient_c=options.ambient_c)
            print("\n".join(first.notes))
            show_case(read_case(first.folder), assumed)
            rest_c = level_c(read_case(first.folder))
            second = compose(store, name, assumed, Path(made) / "level", ambient_c=rest_c)
            print(f"\nthe same with surroundings of {rest_c:.0f} °C, the level of the standing spindle in the fitted runs")
            show_case(read_case(second.folder), assumed)
        finally:
            store.close()


if __name__ == "__main__":
    main()
