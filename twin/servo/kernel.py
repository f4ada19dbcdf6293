"""The text of the axis kernel: control and mechanics of many lanes, tick by tick.

A lane is one axis of one candidate machine. W lanes run side by side, so that the compiler works on as many at a time as the
processor's vectors hold; their constants and states lie in one flat array, `scratch[k * W + lane]`, with offsets that are
numbers in the text. What no output and no state of the next tick needs is not in the text, so an effect, a trace or a
feed-forward that is not used costs nothing.
"""

import ast
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from twin import elementary
from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.servo import controller, friction, mechanics, metrics, table
from twin.weave import Physics, Woven, function_text, quantities, weave

CLOCKS = ("period_s", "step_s", "time_s")
INPUTS = ("reference_mm", "disturbance_n")
STATES = frozenset(
    {
        *("position_mm", "velocity_mm_s", "bristle_mm", "drive_force_n"),
        *("torque_a", "integral_a", "previous_reference_mm", "previous_reference_velocity_mm_s"),
        *metrics.AxisMetrics._fields,
    }
)
"""Names that carry over from one stage or tick to the next; effects bring theirs along."""


def control_stage(measured: bool) -> tuple[Physics, ...]:
    """What happens at a tick."""
    return (
        table.table,
        controller.reference_motion,
        controller.control,
        *([metrics.measure] if measured else []),
        controller.remember,
    )


def move_stage(effects: Iterable[Effect]) -> tuple[Physics, ...]:
    """What happens between two ticks, in one or more steps."""
    bent = any("bristle_compliance_mm_per_n" in effect.changes for effect in effects)
    return (mechanics.forces, friction.breakaway, friction.sliding, mechanics.slide, mechanics.bend if bent else mechanics.arrive)


ALL_PHYSICS = (
    *control_stage(measured=True),
    mechanics.forces,
    friction.breakaway,
    friction.sliding,
    mechanics.slide,
    mechanics.bend,
)


@cache
def axis_quantities() -> dict[str, str]:
    """The quantities of an axis that an effect can change or a recording replace, with their sites."""
    return quantities(ALL_PHYSICS)


@dataclass(frozen=True, slots=True)
class AxisKernel:
    """The text, and what lies where.

    scratch: names by row of the scratch array: states first, then constants
    states: how many of them are states
    recorded: quantities that are read from recordings, in the order of their arguments
    """

    text: str
    scratch: tuple[str, ...]
    states: int
    recorded: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Stage:
    """A stage's statements with what is dead taken out."""

    statements: tuple[ast.stmt, ...]
    takes: frozenset[str]
    sets: frozenset[str]


def _names(node: ast.AST, context: type[ast.expr_context]) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, context)}


def _called(statement: ast.stmt) -> set[str]:
    return {n.func.id for n in ast.walk(statement) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}


def _alive(woven: Woven, wanted: frozenset[str]) -> _Stage:
    """The statements that `wanted` depends on."""
    live, kept = set(wanted), list[ast.stmt]()
    sets: set[str] = set()
    for statement in reversed(ast.parse(woven.body).body):
        targets = _names(statement, ast.Store)
        if targets & live:
            live = (live - targets) | (_names(statement, ast.Load) - _called(statement))
            sets |= targets
            kept.append(statement)
    return _Stage(tuple(reversed(kept)), frozenset(live & _read(kept)), frozenset(sets))


def _read(statements: Iterable[ast.stmt]) -> set[str]:
    return {name for statement in statements for name in _names(statement, ast.Load)}


@cache
def axis_kernel(
    lanes: int,
    effects: tuple[Effect, ...] = (),
    recorded: tuple[str, ...] = (),
    own_inputs: tuple[str, ...] = (),
    disturbed: bool = False,
    outputs: tuple[str, ...] = ("position_mm", "torque_a"),
    measured: bool = False,
) -> AxisKernel:
    """The kernel for `lanes` lanes side by side.

    effects: that are in it; recorded: quantities that are replaced; own_inputs: inputs (`reference_mm`, `disturbance_n`,
    recorded quantities) that each lane has its own of, (ticks, lanes), where the others are shared, (ticks,); disturbed: whether
    there is a disturbance_n; outputs: names to keep at each tick; measured: whether sums and peaks are kept
    (`twin.servo.metrics`)
    """
    for name in recorded:
        if name not in axis_quantities():
            raise EffectError(f"{name!r} is not a quantity that can be replaced; these are: {', '.join(axis_quantities())}")
    at_tick = weave(control_stage(measured), effects, [q for q in recorded if q in quantities(control_stage(measured))])
    between = weave(move_stage(effects), effects, [q for q in recorded if q in quantities(move_stage(effects))])
    kept = set(metrics.AxisMetrics._fields) if measured else set()
    wanted = frozenset(outputs) | kept | {"position_mm", "velocity_mm_s"}
    control, move = _alive(at_tick, wanted), _alive(between, wanted)
    while True:  # until what one stage needs is what the other one leaves
        needed = wanted | control.takes | move.takes
        grown = _alive(at_tick, frozenset(needed)), _alive(between, frozenset(needed))
        if grown == (control, move) or all(
            (new.takes, new.sets) == (old.takes, old.sets) for new, old in zip(grown, (control, move), strict=True)
        ):
            break
        control, move = grown
    taken, set_ = control.takes | move.takes, control.sets | move.sets
    fed = {*CLOCKS, *INPUTS, *(f"recorded__{name}" for name in recorded)}
    own = {f"{effect.name}__{name}" for effect in effects for name in effect.states}
    states = tuple(sorted((taken & set_ & (STATES | own)) | kept))
    constants = tuple(sorted(taken - set(states) - fed))
    layout = _Layout(lanes, (*states, *constants), states, own_inputs, disturbed)
    text = (
        "from math import copysign\n\n\n"
        + "\n\n\n".join(_functions(at_tick, between))
        + "\n\n\n"
        + layout.kernel(control, move, recorded, outputs)
    )
    return AxisKernel(text, layout.scratch, len(states), recorded)


def _functions(*woven: Woven) -> list[str]:
    texts = [function_text(elementary.exp_of_minus), function_text(elementary.sine_of_turns)]
    texts += list(dict.fromkeys(text for stage in woven for text in stage.functions))
    return [f"@njit(error_model='numpy')\n{text}" for text in texts]


@dataclass(frozen=True, slots=True)
class _Layout:
    """Writes statements as loops over lanes."""

    lanes: int
    scratch: tuple[str, ...]
    states: tuple[str, ...]
    own_inputs: tuple[str, ...]
    disturbed: bool

    def kernel(self, control: _Stage, move: _Stage, recorded: tuple[str, ...], outputs: tuple[str, ...]) -> str:
        arguments = ["reference_mm_in", *(["disturbance_n_in"] if self.disturbed else []), *(f"{name}_in" for name in recorded)]
        at_tick = control.sets | control.takes | {*INPUTS, "position_mm", "velocity_mm_s"}
        here = [name for name in outputs if name in at_tick]
        later = [name for name in outputs if name not in here]
        lines = [
            "@njit(cache=True, nogil=True, error_model='numpy')",
            f"def axes(first_tick, ticks, steps, period_s, scratch, {', '.join(arguments)}, outputs):",
            "    step_s = period_s / steps",
            "    for tick in range(ticks):",
            "        tick_time_s = (first_tick + tick) * period_s",
            *self._loop(control, recorded, [(outputs.index(n), n) for n in here], 8, "tick_time_s"),
            "        for step in range(steps):",
            *self._loop(move, recorded, [(outputs.index(n), n) for n in later], 12, "tick_time_s + step * step_s"),
        ]
        return "\n".join(lines) + "\n"

    def _loop(self, stage: _Stage, recorded: tuple[str, ...], kept: list[tuple[int, str]], indent: int, time: str) -> list[str]:
        read = stage.takes | {name for _, name in kept}
        body = [f"time_s = {time}"] if "time_s" in read else []
        body += [f"{n} = {self._input(n)}" for n in (*INPUTS, *(f"recorded__{q}" for q in recorded)) if n in read]
        body += [f"{name} = scratch[{row * self.lanes} + lane]" for row, name in enumerate(self.scratch) if name in read]
        body += [ast.unparse(statement) for statement in stage.statements]
        body += [f"outputs[({row} * ticks + tick) * {self.lanes} + lane] = {name}" for row, name in kept]
        body += [f"scratch[{row * self.lanes} + lane] = {n}" for row, n in enumerate(self.states) if n in stage.sets]
        return [" " * indent + f"for lane in range({self.lanes}):", *(" " * (indent + 4) + line for line in body)]

    def _input(self, name: str) -> str:
        quantity = name.removeprefix("recorded__")
        if quantity == "disturbance_n" and not self.disturbed:
            return "0.0"
        return f"{quantity}_in[tick * {self.lanes} + lane]" if quantity in self.own_inputs else f"{quantity}_in[tick]"
