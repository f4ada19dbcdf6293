#!/usr/bin/env python3
"""Measure where recorded parts take longer than length over feed, which effects cause it, and how far the gap shrinks on other
parts.

    .venv/bin/python benchmarks/gap/program_time.py [--without-overrides | --one-by-one] [--withheld] [--json]

Recordings: ten plates of the NIST Smart Manufacturing Systems Test Bed (CNCTWIN_DATA or ../shared/data), imported as run logs
into a case. The twin knows nothing of the control; effects are fitted on plates 13, 14 and 15 and judged on all other runs of the
case. Those of the back face and those that were aborted are among them: the diagnosis has to say so by itself.

--one-by-one: each recording is imported by itself, so that a knob that stands where the one before left it is not recorded
--withheld: programs of a shop run by a control that has one or two of the effects, recorded every 0.15 s, and diagnosed
"""

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.programs.columns import program_columns
from benchmarks.programs.plates import FITTED, PLATES, data_folder
from twin.case import Case, read_case
from twin.gap.diagnosis import Diagnosed
from twin.gap.programs.diagnose import diagnose_programs
from twin.motion.control import LENGTH_OVER_FEED, changed
from twin.motion.path import path_from_moves
from twin.motion.sampling import sampled
from twin.programs import interpret
from twin.recording.observations import last_values, read_observations
from twin.recording.program_run import OVERRIDES, program_runs
from twin.runlog import run_log, write_run

MACHINE = "[machine]\nname = '{}'\n"
RUN = "\n[[runs]]\nfile = '{}'\nkind = 'program'\nrole = '{}'\nprogram = '{}'\n"
WITHHELD: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "nothing": {},
    "corner_slowdown": {"corner_slowdown": {"acceleration_mm_s2": 400.0, "corner_mm_min": 300.0}},
    "block_overhead": {"block_overhead": {"block_s": 0.1}},
    "tool_change_time": {"tool_change_time": {"change_s": 3.0, "up_rpm_s": 5000.0, "down_rpm_s": 5000.0}},
    "feed_override": {"feed_override": {"ratio": 0.9}},
    "corner_slowdown + tool_change_time": {
        "corner_slowdown": {"acceleration_mm_s2": 800.0, "corner_mm_min": 500.0, "rapid_mm_s2": 2000.0},
        "tool_change_time": {"change_s": 2.0},
    },
    "block_overhead + feed_override": {"block_overhead": {"block_s": 0.08}, "feed_override": {"ratio": 1.1}},
}


def plates_case(
    data: Path,
    folder: Path,
    names: Sequence[str] = PLATES,
    fitted: Sequence[str] = FITTED,
    *,
    overrides: bool = True,
    carried: bool = True,
) -> Case:
    """Every run in the recordings of the plates, imported into a case in `folder`, each beside the program of its plate.

    overrides: keep what the knobs stood at; carried: from one recording to the next
    """
    entries, before = [], {}
    for name in names:
        observed = read_observations(
            (data / "nist" / "plate" / f"Plate-Hurco04-{name}of20.txt").read_text(encoding="utf-8"), name
        )
        program = data / "nist" / "nc" / f"NIST_MTC_CRADA_PLATE-{int(name)}.NC"
        (folder / f"plate_{name}.nc").write_text(program.read_text(encoding="utf-8"), encoding="utf-8")
        for number, run in enumerate(program_runs(observed, before), start=1):
            file = f"plate_{name}_{number}.parquet"
            columns = {name: values for name, values in run.columns.items() if overrides or name not in OVERRIDES.values()}
            write_run(run_log(columns, file), folder / file)
            entries.append(RUN.format(file, "fit" if name in fitted else "check", f"plate_{name}.nc"))
        before |= last_values(observed.rows) if carried else {}
    return _case(folder, "plates", entries)


def shop_program(feed: float, seed: int) -> str:
    """Three tools; zigzags, long cuts, stairs of short blocks and arcs, rapids between: some 100 s at F2000."""
    rng = np.random.default_rng(seed)
    blocks = ["%", "G21 G90 G17"]
    for tool, rpm in ((1, 3000), (2, 6000), (3, 8000)):
        blocks += [f"T{tool} M6", f"S{rpm} M3", "G0 X0 Y0 Z20"]
        for k in range(6):
            x, y = 30.0 * k, 10.0 * tool
            blocks += [f"G0 X{x:.1f} Y{y:.1f}", "G0 Z2", f"G1 Z-1 F{feed / 2:.0f}", f"F{feed:.0f}"]
            blocks += [f"G1 X{x + rng.uniform(2, 12):.2f} Y{y + n % 2 * rng.uniform(2, 8):.2f}" for n in range(8)]
            blocks += [f"G1 X{x + 12 + 0.4 * n:.2f} Y{y + 0.3 * (n % 2):.2f}" for n in range(1, 20)]
            blocks += [f"G2 X{x + 20:.2f} Y{y:.2f} R15", f"G1 X{x + 60:.2f}", "G0 Z20"]
        blocks += ["M5"]
    return "\n".join([*blocks, "G0 X-150 Y0", "M30", "%", ""])


def withheld_case(folder: Path, effects: Mapping[str, Mapping[str, float]], period_s: float = 0.15) -> Case:
    """Three programs to learn from and two to judge on, run by a control with these effects."""
    entries = []
    for number, (feed, role) in enumerate([(1200, "fit"), (2400, "fit"), (4000, "fit"), (1700, "check"), (3200, "check")]):
        text = shop_program(feed, number)
        motion = sampled(changed(LENGTH_OVER_FEED, effects).plan(path_from_moves(interpret(text))), period_s)
        columns: dict[str, NDArray[np.generic]] = program_columns(motion)
        write_run(run_log(columns, f"made_{number}"), folder / f"made_{number}.parquet")
        (folder / f"made_{number}.nc").write_text(text, encoding="utf-8")
        entries.append(RUN.format(f"made_{number}.parquet", role, f"made_{number}.nc"))
    return _case(folder, "made", entries)


def _case(folder: Path, name: str, entries: Sequence[str]) -> Case:
    (folder / "machine.toml").write_text(MACHINE.format(name), encoding="utf-8")
    (folder / "case.toml").write_text(f"[case]\nname = '{name}'\nmachine = 'machine.toml'\n" + "".join(entries), encoding="utf-8")
    return read_case(folder)


def show(found: Diagnosed) -> None:
    """Print a diagnosis."""
    d = found.diagnosis
    print(f"{d.verdict.value}: {d.sentence}")
    print("\nwhere, before")
    for cell in d.where:
        print(f"  {cell.sentence}; {cell.effect_size:.0f} floors, p {cell.significance:.1g}")
    print("\nwhere, after")
    for cell in d.where_after:
        print(f"  {cell.sentence}; {cell.effect_size:.1f} floors")
    print("\ncauses")
    for cause in d.causes:
        print(f"  {cause.effect}: closes {100 * cause.closure:.1f} %, in {100 * cause.probability:.0f} % of resampled runs")
        for name, value in cause.parameters.items():
            print(f"    {name} = {value.value:.4g} {value.unit} ({value.low:.4g} to {value.high:.4g})")
    print("\ncandidates, alone")
    for one in d.candidates:
        print(f"  {one.effect}: closes {100 * one.closure:.1f} %, p {one.p_value:.3f}")
    g = d.gap
    print(f"\nclosure {100 * g.closure:.2f} % ({100 * g.closure_low:.2f} to {100 * g.closure_high:.2f})")
    for name, signal in g.by_signal.items():
        print(f"  {name}: {signal.before:.3g} → {signal.after:.3g} {signal.unit}, floor {signal.floor:.3g}")
    ends = [(t.after[-1], t.measured[-1]) for t in found.traces if t.signal == "program_time_s" and not t.fitted]
    print(f"  whole programs: median error {100.0 * float(np.median([abs(a / m - 1.0) for a, m in ends])):.2f} %")
    for note in (*d.notes, *(f"not identifiable: {name}" for name in d.not_identifiable)):
        print(f"note: {note}")


def withheld(as_json: bool) -> list[dict[str, object]]:
    """Diagnose each of WITHHELD; print a line each unless they are to be JSON."""
    rows: list[dict[str, object]] = []
    for title, effects in WITHHELD.items():
        with tempfile.TemporaryDirectory() as made:
            case, begun = withheld_case(Path(made), effects), perf_counter()
            d = diagnose_programs(case).diagnosis
        named, g = sorted(cause.effect for cause in d.causes), d.gap
        right = named == sorted(effects)
        rows.append({"withheld": title, "named": named, "right": right, "verdict": d.verdict.value, "closure": g.closure})
        if not as_json:
            gap = f"{g.before:.3g} → {g.after:.3g} floors, closure {100 * g.closure:.2f} %"
            names = " + ".join(named) or "nothing"
            seconds = perf_counter() - begun
            print(f"{title:36} {'right' if right else 'WRONG'}  {d.verdict.value}: {names}; {gap} ({seconds:.0f} s)")
    return rows


def main() -> None:
    """Print the diagnosis, or its JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--without-overrides", action="store_true", help="as if nobody had recorded what the knobs stood at")
    parser.add_argument("--one-by-one", action="store_true", help="each recording imported by itself")
    parser.add_argument("--withheld", action="store_true")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    if arguments.withheld:
        rows = withheld(arguments.json)
        print(json.dumps(rows, indent=1) if arguments.json else "")
        return
    with tempfile.TemporaryDirectory() as made:
        begun = perf_counter()
        case = plates_case(data_folder(), Path(made), overrides=not arguments.without_overrides, carried=not arguments.one_by_one)
        imported = perf_counter()
        found = diagnose_programs(case)
    if arguments.json:
        print(found.diagnosis.to_json(), end="")
        return
    show(found)
    print(f"\n{imported - begun:.1f} s to import, {perf_counter() - imported:.1f} s to diagnose")


if __name__ == "__main__":
    main()
