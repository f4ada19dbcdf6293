"""The plain C loop that the simulated machine is measured beside (benchmarks/simulator.c), and the motion that both are given."""

import ctypes
import math
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.machine import MachineFile
from twin.motion.path import Path as ToolPath
from twin.motion.path import path_from_moves
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.programs import interpret
from twin.servo.constants import axis_constants

Floats = NDArray[np.float64]
Run = Callable[[], object]
PERIOD_S = 0.001
SOURCE = Path(__file__).with_name("simulator.c")


@dataclass(frozen=True, slots=True)
class Motion:
    """A program run over and over for so many ticks.

    reference_mm: axis → (ticks,); path: with its geometry; ticks
    """

    path: ToolPath
    reference_mm: Mapping[str, Floats]
    ticks: int


def motion_of(machine: MachineFile, text: str, ticks: int) -> Motion:
    """The motion of a program, repeated until it is long enough, and then cut off."""
    assert machine.program is not None
    repeats = 1
    while True:
        path = path_from_moves(interpret("G90 G54\n" + text * repeats + "M30\n"))
        planned = plan(path, machine.program)
        if planned.total_s >= ticks * PERIOD_S:
            break
        repeats = max(repeats + 1, math.ceil(repeats * ticks * PERIOD_S / planned.total_s))
    reference = sampled(planned, PERIOD_S).reference_mm[:ticks]
    return Motion(path, {a: np.ascontiguousarray(reference[:, i]) for i, a in enumerate("xyz")}, ticks)


class PlainLoop:
    """benchmarks/simulator.c, compiled with these options of gcc."""

    def __init__(self, folder: Path, options: tuple[str, ...]) -> None:
        library = folder / f"simulator{''.join(options)}.so".replace("=", "-")
        subprocess.run(["gcc", *options, "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))

    def bound(self, machine: MachineFile, motion: Motion, traces: bool) -> tuple[Run, dict[str, Floats]]:
        """A call that runs all axes, and what it fills: axis → (2, ticks) position and torque, or (4,) sums and peaks."""
        out = {a: np.zeros((2, motion.ticks) if traces else (1, 4)) for a in machine.axes}
        calls: list[list[object]] = []
        kept: list[object] = [out]  # what the pointers point to
        for letter, axis in machine.axes.items():
            c = axis_constants(axis)
            names = ["mass_kg", "newton_per_command", "position_gain_per_s", "velocity_gain_a_s_per_mm"]
            names += ["velocity_integral_gain_a_per_mm", "torque_limit_a"]
            for name in ("coulomb_{}_n", "static_{}_n", "stribeck_{}_s_per_mm", "viscous_{}_n_s_per_mm"):
                names += [name.format("minus"), name.format("plus")]
            constants = np.array([c[name] for name in names])
            arrays = [constants, motion.reference_mm[letter], *out[letter]]
            kept.append(arrays)
            pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
            calls.append([pointers[0], ctypes.c_long(motion.ticks), ctypes.c_double(PERIOD_S), *pointers[1:]])
        function = self._library.with_traces if traces else self._library.with_sums

        def call() -> list[object]:
            for arguments in calls:
                function(*arguments)
            return kept

        return call, out
