"""A part program on the twin as on a machine: its run log, its time, its greatest force and following error."""

from dataclasses import dataclass
from pathlib import Path

import twin.simulator.simulation
from cnctwin.batch.simulation import Summary, summary_of
from cnctwin.files.called_programs import with_called_programs
from cnctwin.interface.errors import one_tree
from cnctwin.interface.machine import machine_of
from cnctwin.interface.part_program import part_program
from cnctwin.interface.run import Run
from twin.machine import MachineFile


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """A simulated run.

    run: what the machine would record, at its servo period; figures: rms and peak by axis, force, load, heat
    notes: what the machine's description does not state and was taken for granted, and what a person should know
    """

    run: Run
    figures: Summary
    notes: tuple[str, ...]

    @property
    def seconds(self) -> float:
        """Time that the program takes."""
        return self.figures.seconds

    @property
    def peak_force_n(self) -> float | None:
        """Greatest cutting force; None where nothing is cut."""
        return None if self.figures.cutting_force_n is None else self.figures.cutting_force_n.peak

    @property
    def peak_following_error_mm(self) -> float | None:
        """Greatest following error of a linear axis; None where the machine describes none. Each axis: `figures.axes`."""
        return max((a.following_error.peak for a in self.figures.axes.values() if a.unit == "mm"), default=None)


def simulate(
    program: str | Path,
    machine: MachineFile | str | Path,
    *,
    seed: int | None = None,
    ambient_temp_c: float = 22.0,
    start_temperature_c: float | None = None,
) -> Simulated:
    """Run a part program on a machine.

    program: a Path is a file, a str the text itself; machine: as `read_machine` gives it, or the name of its file
    seed: None = the machine's mean course, free of noise; a number = one course as its sensors would record it
    start_temperature_c: of the spindle; None = ambient

    Raises ProgramError where a control would refuse the program, MachineError.
    """
    described, read = machine_of(machine), part_program(program)
    with one_tree(str(program) if isinstance(program, Path) else read.name):
        settings = twin.simulator.simulation.program_settings(described)
        if isinstance(program, Path):
            settings = with_called_programs(settings, program, read.text)
        done = twin.simulator.simulation.simulate(
            described,
            read.text,
            settings=settings,
            seed=seed,
            start_temperature_c=start_temperature_c,
            ambient_temp_c=ambient_temp_c,
            name=read.name,
        )
    return Simulated(Run(done.run), summary_of(done), done.notes)
