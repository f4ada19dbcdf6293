"""Woven statements as loops over lanes.

A stage is cut into several loops where it is long: a processor looks a few hundred instructions ahead, and a shorter body lets it
work on several vectors of lanes at once. What one loop sets and a later one reads is carried in a row of the scratch array.
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field

from twin.kernels.assembly import KERNEL

CLOCKS = ("period_s", "step_s", "time_s")
INPUTS = ("reference_mm", "disturbance_n")
CUTS = ("following_error_mm", "speed_ratio", "inertia_kg", "bristle_compliance_mm_per_n")
"""Quantities before which a stage is cut: after the table and the reference, the forces, the friction, the rigid step."""
CUT_LANES_MIN = 32
"""Fewer lanes are one or two vectors: nothing to work on side by side."""


def names_of(node: ast.AST, context: type[ast.expr_context]) -> set[str]:
    """Names that a piece of text reads or sets."""
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, context)}


def read_by(statement: ast.stmt) -> set[str]:
    """Names that a statement reads, without the functions that it calls."""
    called = {n.func.id for n in ast.walk(statement) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    return names_of(statement, ast.Load) - called


@dataclass(frozen=True, slots=True)
class Stage:
    """Statements with what is dead taken out; names that they read before they set them, and names that they set."""

    statements: tuple[ast.stmt, ...]
    takes: frozenset[str]
    sets: frozenset[str]


def _stage(statements: Sequence[ast.stmt]) -> Stage:
    takes: set[str] = set()
    sets: set[str] = set()
    for statement in statements:
        takes |= read_by(statement) - sets
        sets |= names_of(statement, ast.Store)
    return Stage(tuple(statements), frozenset(takes), frozenset(sets))


def _parts(stage: Stage) -> list[Stage]:
    """The stage, cut before the first statement that sets one of CUTS."""
    parts: list[list[ast.stmt]] = [[]]
    seen: set[str] = set()
    for statement in stage.statements:
        cut = (names_of(statement, ast.Store) & set(CUTS)) - seen
        if cut and parts[-1]:
            parts.append([])
        seen |= cut
        parts[-1].append(statement)
    return [_stage(part) for part in parts]


@dataclass(slots=True)
class LaneLoops:
    """Writes the kernel.

    scratch: names by row: states, then constants; states: those that are states; own_inputs: those of which each lane has its own
    fed: series beside INPUTS, by the names that the statements read; disturbed: whether there is a disturbance
    """

    lanes: int
    scratch: tuple[str, ...]
    states: tuple[str, ...]
    own_inputs: tuple[str, ...]
    fed: tuple[str, ...]
    disturbed: bool
    carried: dict[str, int] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Rows of the scratch array."""
        return len(self.scratch) + len(self.carried)

    def kernel(self, control: Stage, move: Stage, outputs: tuple[str, ...]) -> str:
        """The function `axes`."""
        arguments = ["reference_mm_in", *(["disturbance_n_in"] if self.disturbed else []), *(f"{q}_in" for q in self.fed)]
        at_tick = control.sets | control.takes | {*INPUTS, "position_mm", "velocity_mm_s"}
        here = [(row, name) for row, name in enumerate(outputs) if name in at_tick]
        later = [(row, name) for row, name in enumerate(outputs) if name not in at_tick]
        lines = [
            KERNEL,
            f"def axes(first_tick, ticks, steps, period_s, scratch, {', '.join(arguments)}, lanes, first_lane, outputs):",
            "    step_s = period_s / steps",
            "    for tick in range(ticks):",
            "        tick_time_s = (first_tick + tick) * period_s",
            *self._loops(control, here, 8, "tick_time_s"),
            "        for step in range(steps):",
            *self._loops(move, later, 12, "tick_time_s + step * step_s"),
        ]
        return "\n".join(lines)

    def _loops(self, stage: Stage, kept: list[tuple[int, str]], indent: int, time: str) -> list[str]:
        parts = _parts(stage) if self.lanes >= CUT_LANES_MIN else [stage]
        where = {name: row for row, name in enumerate(self.scratch)}
        lines = []
        for number, part in enumerate(parts):
            last = number == len(parts) - 1
            outs = kept if last else []
            read = part.takes | ({name for _, name in outs} - part.sets)
            body = [f"time_s = {time}"] if "time_s" in read else []
            body += [f"{n} = {self._input(n)}" for n in (*INPUTS, *self.fed) if n in read]
            body += [f"{n} = scratch[{where[n] * self.lanes} + lane]" for n in sorted(read & set(where))]
            body += [ast.unparse(statement) for statement in part.statements]
            body += [f"outputs[({row} * lanes + first_lane + lane) * ticks + tick] = {name}" for row, name in outs]
            wanted = {name for later in parts[number + 1 :] for name in later.takes} | {name for _, name in kept if not last}
            for name in sorted(part.sets & (wanted | set(self.states))):
                if name not in self.states:
                    where[name] = len(self.scratch) + self.carried.setdefault(name, len(self.carried))
                body.append(f"scratch[{where[name] * self.lanes} + lane] = {name}")
            lines += [" " * indent + f"for lane in range({self.lanes}):", *(" " * (indent + 4) + line for line in body)]
        return lines

    def _input(self, name: str) -> str:
        if name == "disturbance_n" and not self.disturbed:
            return "0.0"
        return f"{name}_in[tick * {self.lanes} + lane]" if name in self.own_inputs else f"{name}_in[tick]"
