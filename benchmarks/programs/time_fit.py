"""The time of programs on a machine: the control's parameters, fitted to recorded runs by least squares, with intervals.

What is compared: the active seconds between two lines, a second or more apart, as the plan has them and as the recording has
them (active = without the pauses that the recording itself shows). The recorder asks the control every 0.16 s or so; a robust
loss keeps single hiccups from counting. Fitted in the logarithm, so that all are positive and an interval is a factor. The
rapid rate isn't fitted but read off the recorded speeds; overrides come from the run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.errors import RunLogError
from twin.gap.programs.fit import HICCUP_S
from twin.identification.estimate import Estimate
from twin.motion.limits import Limits
from twin.motion.plan import Plan, plan
from twin.recording.recorded_program import NOMINAL, RecordedProgram, SetUp, line_starts, rapid_rate_mm_min, windows

Floats = NDArray[np.float64]
WINDOW_S = 1.0
"""Shortest time that is compared: several times what the recorder takes to ask."""
DETERMINED = 0.5
"""A parameter is determined where one standard deviation of its logarithm is less than this (a factor of 1.65)."""

SET_UP = ("reference_z", "tool_change_x", "tool_change_y")
"""Places, in mm: fitted as they are, the rest in the logarithm."""
SCALE_MM = 100.0
ORIGIN = 10.0
"""Origin of the free variables, ORIGIN + ln(value / start) or ORIGIN + (value − start) / scale: one relative step suits all."""
START: dict[str, float] = {
    "acceleration_mm_s2": 300.0,
    "centripetal_mm_s2": 300.0,
    "corner_speed_difference_mm_min": 100.0,
    "corner_deviation_mm": 0.1,
    "jerk_mm_s3": 100000.0,
    "rapid_acceleration_mm_s2": 1000.0,
    "rapid_jerk_mm_s3": 100000.0,
    "in_position_s": 0.05,
    "block_time_s": 0.02,
    "tool_change_s": 5.0,
    "spindle_acceleration_rpm_s": 5000.0,
    "spindle_deceleration_rpm_s": 4000.0,
    "reference_z": 350.0,
    "tool_change_x": -150.0,
    "tool_change_y": -250.0,
}
"""Parameters that can be fitted, and where the search begins. All but the places are fields of `Limits`."""
PARAMETERS = tuple(
    name for name in START if name not in {"corner_deviation_mm", "jerk_mm_s3", "rapid_jerk_mm_s3", "block_time_s"}
)
"""The parameters that are fitted by default: the others gained nothing on these recordings (docs/explanation/program-time.md)."""
SPINDLE_BASE_RPM = 3000.0
"""Spindle motors give constant power from a quarter or so of their top speed on. Assumed where `spindle_ramp` has no run-ups."""


@dataclass(frozen=True, slots=True)
class ProgramTimes:
    """The fitted control. limits: at 100 % override; set_up: of these runs."""

    limits: Limits
    set_up: SetUp
    estimates: tuple[Estimate, ...]
    residual_s: float
    windows: int

    def plan(self, program: RecordedProgram, overrides: bool = True) -> Plan:
        """The plan of a program; `overrides`: as its run was driven, else at 100 %."""
        feed, rapid = program.overrides() if overrides else (np.ones(len(program.path)), np.ones(len(program.path)))
        return plan(program.with_set_up(self.set_up), self.limits, feed, rapid)


@dataclass(frozen=True, slots=True)
class Section:
    """The seconds from one tool change to the next: recorded (active) and predicted."""

    tool: int
    recorded_s: float
    predicted_s: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """A program's predicted and recorded active time, whole and by tool section."""

    name: str
    recorded_s: float
    predicted_s: float
    sections: tuple[Section, ...]

    @property
    def relative_error(self) -> float:
        """(predicted − recorded) / recorded of the whole."""
        return self.predicted_s / self.recorded_s - 1.0


def identify_program_times(
    programs: Sequence[RecordedProgram],
    parameters: Sequence[str] = PARAMETERS,
    fixed: Limits | None = None,
    overrides: bool = True,
) -> ProgramTimes:
    """Fit `parameters` (names of START) to `programs`.

    fixed: the rest; default: the rapid rate read off the runs, rapids that wait for the spindle, SPINDLE_BASE_RPM, no other limit
    overrides: replay those of the runs

    Raises RunLogError where a run can't be judged against its program.
    """
    for program in programs:
        if why := program.refusal():
            raise RunLogError(f"{program.name}: {why}; leave it out")
    base = fixed or ideal_limits(programs).with_(rapid_waits_for_spindle=True, spindle_base_rpm=SPINDLE_BASE_RPM)
    measured = [windows(program, WINDOW_S) for program in programs]
    driven = [program.overrides() if overrides else (1.0, 1.0) for program in programs]

    def residuals(free: Floats) -> Floats:
        limits, set_up = _apply(base, parameters, free)
        parts = []
        for program, (begin, line), (feed, rapid) in zip(programs, measured, driven, strict=True):
            predicted = line_starts(plan(program.with_set_up(set_up), limits, feed, rapid), line)
            parts.append(np.diff(predicted) - np.diff(begin))
        return np.concatenate(parts)

    start = np.full(len(parameters), ORIGIN)
    if not parameters:
        apart = residuals(start)
        return ProgramTimes(base, NOMINAL, (), float(np.sqrt(np.mean(apart**2))), len(apart))
    fit = least_squares(
        residuals,
        start,
        loss="soft_l1",
        f_scale=HICCUP_S,
        diff_step=np.full(len(start), 3e-4),
        x_scale=0.3,
        bounds=(start - 7.0, start + 7.0),
    )
    limits, set_up = _apply(base, parameters, fit.x)
    rms = float(np.sqrt(np.mean(np.square(fit.fun))))
    return ProgramTimes(
        limits, set_up, _estimates(parameters, fit.x, np.asarray(fit.jac, dtype=np.float64), 2.0 * fit.cost), rms, len(fit.fun)
    )


def ideal_limits(programs: Sequence[RecordedProgram]) -> Limits:
    """No limit but the rapid rate that the recordings show."""
    return Limits(rapid_mm_min=rapid_rate_mm_min(programs)[0], acceleration_mm_s2=np.inf)


def _apply(base: Limits, parameters: Sequence[str], free: Floats) -> tuple[Limits, SetUp]:
    values = {name: _value(name, one) for name, one in zip(parameters, free.tolist(), strict=True)}
    places = {name: values.pop(name) for name in SET_UP if name in values}
    return base.with_(**values), NOMINAL._replace(**places)


def _value(name: str, free: float) -> float:
    if name in SET_UP:
        return START[name] + SCALE_MM * (free - ORIGIN)
    return START[name] * float(np.exp(free - ORIGIN))


def _estimates(parameters: Sequence[str], free: Floats, jacobian: Floats, squares: float) -> tuple[Estimate, ...]:
    """95 % intervals from the curvature at the optimum; a direction that nothing depends on gets an endless one."""
    _u, singular, v = np.linalg.svd(jacobian, full_matrices=False)
    weak = singular < 1e-9 * singular[0]
    inverse = np.where(weak, 1e9, 1.0 / np.where(weak, 1.0, singular))
    variance = squares / max(len(jacobian) - len(free), 1) * np.sum((v.T * inverse) ** 2, axis=1)
    deviation = np.sqrt(variance)
    return tuple(_estimate(name, *pair) for name, *pair in zip(parameters, free.tolist(), deviation.tolist(), strict=True))


def _estimate(name: str, free: float, deviation: float) -> Estimate:
    reach = min(1.96 * deviation, 50.0)
    low, value, high = (_value(name, free + side * reach) for side in (-1.0, 0.0, 1.0))
    return Estimate(name, value, low, high, "", None, 1.0 if deviation < DETERMINED else 0.0)


def compare(program: RecordedProgram, planned: Plan) -> Comparison:
    """Predicted and recorded active time of a run, whole and by tool section (a section begins at its M6 line)."""
    begin, line = program.run.line_changes()
    changes = program.tool_changes
    edges = np.array([change for change, _ in changes[1:]], dtype=np.int64)
    at = np.minimum(np.searchsorted(line, edges), len(line) - 1)
    recorded = np.diff(np.concatenate([[0.0], begin[at], [program.run.active_s]]))
    predicted = np.diff(np.concatenate([[0.0], line_starts(planned, line[at]), [planned.total_s]]))
    sections = tuple(Section(tool, float(r), float(p)) for (_, tool), r, p in zip(changes, recorded, predicted, strict=True))
    return Comparison(program.name, program.run.active_s, planned.total_s, sections)
