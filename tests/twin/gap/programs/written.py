"""Cases of recorded programs: made by a control whose effects are known, or cut out of the recorded plates."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.programs.columns import program_columns
from tests.recordings import recording
from twin.case import Case, read_case
from twin.motion.control import LENGTH_OVER_FEED, changed
from twin.motion.path import path_from_moves
from twin.motion.sampling import sampled
from twin.programs import interpret
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs
from twin.runlog import RunLog, run_log, write_run

Effects = Mapping[str, Mapping[str, float]]
PERIOD_S = 0.15
"""A recorder asks a control some seven times a second."""
RUN = "\n[[runs]]\nfile = '{0}.parquet'\nkind = 'program'\nrole = '{1}'\nprogram = '{0}.nc'\n"
HEADER_LINES, FIRST_LINE = 11, 2654
"""Of the plates: what comes before the first tool change, and where the last two of the seven tools begin."""


def shop_program(feed: float, tools: Sequence[int] = (1, 2)) -> str:
    """For each tool a zigzag, a stair of short blocks, an arc and a long cut at `feed`, two times."""
    blocks = ["%", "G21 G90 G17"]
    for tool in tools:
        blocks += [f"T{tool} M6", f"S{3000 * tool} M3", "G0 X0 Y0 Z20"]
        for x in (0.0, 80.0):
            blocks += [f"G0 X{x:.1f} Y{10.0 * tool:.1f}", "G0 Z2", f"G1 Z-1 F{feed / 2:.0f}", f"F{feed:.0f}"]
            blocks += [f"G1 X{x + 4 * n:.1f} Y{10.0 * tool + 3 * (n % 2):.1f}" for n in range(1, 7)]
            blocks += [f"G1 X{x + 24 + 0.4 * n:.1f}" for n in range(1, 16)]
            blocks += [f"G2 X{x + 40:.1f} R6", f"G1 X{x + 130:.1f}", f"G1 X{x:.1f}", "G0 Z20"]
        blocks += ["M5"]
    return "\n".join([*blocks, "G0 X-150 Y0", "M30", "%", ""])


def made(text: str, effects: Effects) -> dict[str, NDArray[np.generic]]:
    """Columns of a run log of the program on a control with these effects and no limit else."""
    planned = changed(LENGTH_OVER_FEED, effects).plan(path_from_moves(interpret(text)))
    return program_columns(sampled(planned, PERIOD_S))


def made_case(folder: Path, effects: Effects, feeds: Mapping[str, Sequence[float]], machine: str = "") -> Case:
    """role → feeds: one run each."""
    runs = {f"{role}_{feed:.0f}": (role, shop_program(feed)) for role, own in feeds.items() for feed in own}
    return case_of(
        folder, {name: (role, run_log(made(text, effects), name), text) for name, (role, text) in runs.items()}, machine
    )


def case_of(folder: Path, runs: Mapping[str, tuple[str, RunLog, str]], machine: str = "") -> Case:
    """name → role, run log and program."""
    for name, (_, log, text) in runs.items():
        write_run(log, folder / f"{name}.parquet")
        (folder / f"{name}.nc").write_text(text)
    (folder / "machine.toml").write_text("[machine]\nname = 'made'\n" + machine)
    entries = "".join(RUN.format(name, role) for name, (role, _, _) in runs.items())
    (folder / "case.toml").write_text(f"[case]\nname = 'made'\nmachine = 'machine.toml'\n{entries}")
    return read_case(folder)


def whole_program(name: str) -> str:
    """The program of a plate."""
    return recording(f"nist/nc/NIST_MTC_CRADA_PLATE-{int(name)}.NC").read_text()


def plate_program(name: str) -> str:
    """The program of a plate, its lines up to the last two tools empty."""
    lines = whole_program(name).splitlines()
    return "\n".join(line if n < HEADER_LINES or n >= FIRST_LINE else "" for n, line in enumerate(lines)) + "\n"


def plate_runs(name: str) -> list[dict[str, NDArray[np.generic]]]:
    """Columns of each run in the recording of a plate."""
    text = recording(f"nist/plate/Plate-Hurco04-{name}of20.txt").read_text()
    return [dict(run.columns) for run in program_runs(read_observations(text, name))]


def plate_slice(name: str) -> RunLog:
    """The first run of a plate from its last tool but one on."""
    columns = plate_runs(name)[0]
    first = int(np.argmax(np.asarray(columns["line"]) >= FIRST_LINE))
    # a knob is told only when it turns, and these recordings do not say what it stood at before
    cut = {key: values[first:] for key, values in columns.items() if not key.endswith("_override_pct")}
    return run_log(cut | {"t_s": np.asarray(cut["t_s"], dtype=np.float64) - float(cut["t_s"][0])}, name)
