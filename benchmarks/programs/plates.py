"""The plates of the NIST Smart Manufacturing Systems Test Bed: ten programs of one geometry, and the recordings of their runs."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.programs.spindle import SpindleRamp, run_ups, spindle_ramp
from twin.motion.path import path_from_moves
from twin.programs import Settings, interpret
from twin.recording.observations import last_values, read_observations
from twin.recording.program_run import program_runs
from twin.recording.recorded_program import NOMINAL, RecordedProgram

PLATES = ("01", "02", "03", "04", "10", "11", "13", "14", "15", "19")
FITTED = ("13", "14", "15")
"""The plates that a fit learns from: 9000 rev/min, no knob touched."""


def data_folder() -> Path:
    """Return the folder of the recordings. Exits where the plates are not in it."""
    folder = Path(os.environ.get("CNCTWIN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
    if not (folder / "nist").exists():
        sys.exit(f"no recordings in {folder}/nist; CNCTWIN_DATA names the folder that holds nist/")
    return folder


def plates(folder: Path, names: Sequence[str] = PLATES) -> list[RecordedProgram]:
    """All runs in the recordings of the plates `names`."""
    nist = folder / "nist"
    return recorded_programs(
        [
            (
                f"plate {name}",
                (nist / "nc" / f"NIST_MTC_CRADA_PLATE-{int(name)}.NC").read_text(encoding="utf-8"),
                (nist / "plate" / f"Plate-Hurco04-{name}of20.txt").read_text(encoding="utf-8"),
            )
            for name in names
        ]
    )


def cover_ramp(folder: Path) -> SpindleRamp:
    """The run-up of the same spindle, from the recordings of another part."""
    recordings = sorted((folder / "nist" / "cover").glob("Cover-Hurco04-*.txt"))
    runs = [run for path in recordings for run in program_runs(read_observations(path.read_text(encoding="utf-8"), path.name))]
    return spindle_ramp([one for run in runs for one in run_ups(run)])


def recorded_programs(texts: Sequence[tuple[str, str, str]]) -> list[RecordedProgram]:
    """Every run in recordings of one machine, in order of time: (name, part program, recording) of each.

    A run is named after its recording, the second and third of one with `/2`, `/3`. What the knobs stood at is carried over. A
    recording holds runs of other programs too: `refusal` tells which run is not one of the program beside it.
    """
    settings = Settings(start_mm=_nominal_position(), references_mm=(_nominal_position(),), optional_stop=True)
    before: dict[str, str] = {}
    programs = []
    for name, program, recording in texts:
        observed = read_observations(recording, name)
        path = path_from_moves(
            interpret(program, settings), _nominal_position(), tool_change_mm=(NOMINAL.tool_change_x, NOMINAL.tool_change_y, None)
        )
        for n, run in enumerate(program_runs(observed, before)):
            programs.append(RecordedProgram(f"{name}/{n + 1}" if n else name, path, run))
        before |= last_values(observed.rows)
    return programs


def _nominal_position() -> tuple[float, float, float]:
    return NOMINAL.tool_change_x, NOMINAL.tool_change_y, NOMINAL.reference_z
