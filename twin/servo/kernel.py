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

from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.kernels import elementary
from twin.kernels.assembly import Assembly, kernel_text
from twin.kernels.parsing import parsed
from twin.kernels.weave import Physics, Woven, function_text, quantities, weave
from twin.servo import controller, friction, mechanics, metrics, table
from twin.servo.lanes import CLOCKS, INPUTS, LaneLoops, Stage, names_of, read_by

STATES = frozenset(
    {
        *("position_mm", "velocity_mm_s", "bristle_mm", "drive_force_n", "force_n", "moving_mass_kg"),
        *("torque_a", "integral_a", "previous_reference_mm", "previous_reference_velocity_mm_s"),
        *metrics.AxisMetrics._fields,
    }
)
"""Names that carry over from one stage or tick to the next; effects bring theirs along."""


def control_stage(measured: bool) -> tuple[Physics, ...]:
    """Return the physics of a tick."""
    return (
        table.table,
        controller.reference_motion,
        controller.control,
        *([metrics.measure] if measured else []),
        controller.remember,
    )


def move_stage(effects: Iterable[Effect]) -> tuple[Physics, ...]:
    """Return the physics between two ticks, in one or more steps."""
    bent = any("bristle_compliance_mm_per_n" in effect.changes for effect in effects)
    return (mechanics.forces, friction.breakaway, friction.sliding, mechanics.slide, mechanics.bend if bent else mechanics.arrive)


AXES = Assembly(
    (
        *control_stage(measured=True),
        mechanics.forces,
        friction.breakaway,
        friction.sliding,
        mechanics.slide,
        mechanics.bend,
    ),
    acts_on="the loops or the mechanics of an axis",
    owner="the axes",
)


def axis_quantities() -> dict[str, str]:
    """The quantities of an axis that an effect can change or a recording replace, with their sites."""
    return AXES.quantities()


@dataclass(frozen=True, slots=True)
class AxisKernel:
    """The text, and what lies where.

    scratch: names by row of the scratch array: states first, then constants
    rows: of the scratch array, with those that carry a quantity from one loop to the next
    states: how many of them are states
    fed: series beside reference and disturbance, in the order of their arguments: `recorded__<quantity>`, `added__<quantity>`
    """

    text: str
    scratch: tuple[str, ...]
    rows: int
    states: int
    fed: tuple[str, ...]


def _alive(woven: Woven, wanted: frozenset[str]) -> Stage:
    """The statements that `wanted` depends on."""
    live, kept = set(wanted), list[ast.stmt]()
    sets: set[str] = set()
    for statement in reversed(parsed(woven.body).body):
        targets = names_of(statement, ast.Store)
        if targets & live:
            live = (live - targets) | read_by(statement)
            sets |= targets
            kept.append(statement)
    read = {name for statement in kept for name in read_by(statement)}
    return Stage(tuple(reversed(kept)), frozenset(live & read), frozenset(sets))


@cache
def axis_kernel(
    lanes: int,
    effects: tuple[Effect, ...] = (),
    recorded: tuple[str, ...] = (),
    own_inputs: tuple[str, ...] = (),
    disturbed: bool = False,
    outputs: tuple[str, ...] = ("position_mm", "torque_a"),
    measured: bool = False,
    added: tuple[str, ...] = (),
) -> AxisKernel:
    """The kernel for `lanes` lanes side by side.

    effects: that are in it; recorded: quantities that are replaced; own_inputs: inputs (`reference_mm`, `disturbance_n`,
    other series) that each lane has its own of, (ticks, lanes), where the others are shared, (ticks,); disturbed: whether
    there is a disturbance_n; outputs: names to keep at each tick; measured: whether sums and peaks are kept
    (`twin.servo.metrics`); added: quantities that have a series put on top
    """
    for name in (*recorded, *added):
        if name not in axis_quantities():
            raise EffectError(
                f"{name!r} is not a quantity that can be replaced or added to; these are: {', '.join(axis_quantities())}"
            )
    at_tick, between = (
        weave(physics, effects, *([q for q in some if q in quantities(physics)] for some in (recorded, added)))
        for physics in (control_stage(measured), move_stage(effects))
    )
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
    series = (*(f"recorded__{name}" for name in recorded), *(f"added__{name}" for name in added))
    fed = {*CLOCKS, *INPUTS, *series}
    own = {f"{effect.name}__{name}" for effect in effects for name in effect.states}
    states = tuple(sorted((taken & set_ & (STATES | own)) | kept))
    constants = tuple(sorted(taken - set(states) - fed))
    layout = LaneLoops(lanes, (*states, *constants), states, own_inputs, series, disturbed)
    loops = layout.kernel(control, move, outputs)
    text = kernel_text("from math import copysign", _functions(at_tick, between), [loops])
    return AxisKernel(text, (*states, *constants), layout.rows, len(states), series)


def _functions(*woven: Woven) -> list[str]:
    texts = [function_text(elementary.exp_of_minus), function_text(elementary.sine_of_turns)]
    texts += list(dict.fromkeys(text for stage in woven for text in stage.functions))
    return texts
