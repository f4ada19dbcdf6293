"""The question put to the optimiser, as a value that travels: to a worker, into a checkpoint. And the problem that it makes."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import Any, Self

from twin.effects.added import check_effects
from twin.errors import LimitsError, OptimisationError
from twin.machine import machine_from_toml
from twin.optimisation.allowed import Impossible, allowed, check_tools, limits_of
from twin.optimisation.answer import Objective, SpeedChanges
from twin.optimisation.economy import Economy
from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem, control_of
from twin.optimisation.program import Programmed, programmed
from twin.optimisation.speeds.groups import speed_groups

POPULATION_MAX, EVOLUTIONS_MAX, ISLANDS_MAX = 10_000, 100_000, 64


@dataclass(frozen=True, slots=True)
class Question:
    """A program, a machine, what is wanted, and how to search.

    force_limit_n: None = that of [limits]
    probability: with which the force limit is to be kept; None = with the constants as stated
    margin: the force limit is divided by it, for a limit that is kept with a probability (`twin.optimisation.uncertainty`)
    islands: populations that search beside each other; the answer is the best of them, whoever works them out
    planned: what each line (from 0) cuts, where it is not taken from [stock]: line → [depth mm, entry rad, exit rad]
    left_alone: lines that may not be changed, and why
    pick: which program of the front is written, by its number; None = the one farthest from the line between its ends
    speed_changes: where the spindle may change its speed
    """

    program_text: str
    machine_toml: str
    name: str = "program"
    objective: Objective = Objective.TIME
    force_limit_n: float | None = None
    probability: float | None = None
    margin: float = 1.0
    seed: int = 1
    evolutions: int = 60
    population: int = 64
    islands: int = 2
    planned: Mapping[int, Sequence[Sequence[float]]] | None = None
    left_alone: Mapping[int, str] = field(default_factory=dict)
    pick: int | None = None
    speed_changes: SpeedChanges = SpeedChanges.ANYWHERE

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("evolutions", self.evolutions, 0, EVOLUTIONS_MAX),
            ("population", self.population, 4, POPULATION_MAX),
            ("islands", self.islands, 1, ISLANDS_MAX),
        ):
            if not low <= value <= high:
                raise OptimisationError(f"{name} is {value}; it has to be from {low} to {high}")
        if self.population % 2:
            raise OptimisationError(f"population is {self.population}; it has to be even")
        if self.force_limit_n is not None and not 0.0 < self.force_limit_n < float("inf"):
            raise OptimisationError(f"the force limit is {self.force_limit_n} N; it has to be more than 0")
        if self.pick is not None and self.objective is not Objective.PARETO:
            raise OptimisationError(
                f"pick is {self.pick}, and the objective {self.objective}; only a front has programs to pick from"
            )
        if self.probability is not None and not 0.5 <= self.probability <= 0.9999:
            raise OptimisationError(f"the probability is {self.probability}; it has to be from 0.5 to 0.9999")

    def to_json(self) -> str:
        """As text; `from_json` reads it."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The question that `to_json` wrote."""
        values: dict[str, Any] = json.loads(text)
        for name in ("planned", "left_alone"):
            if values[name] is not None:
                values[name] = {int(line): value for line, value in values[name].items()}
        known = {"objective": Objective(values["objective"]), "speed_changes": SpeedChanges(values["speed_changes"])}
        return cls(**values | known)

    def digest(self) -> str:
        """Return a digest that tells one question from another."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:32]

    def with_(self, **changes: Any) -> "Question":
        """This question with something else in it."""
        return replace(self, **changes)


def problem(question: Question) -> Problem:
    """The problem that a question makes; worked out once for the same question.

    Raises TwinError where program or machine are at fault, LimitsError where the limits leave a line nothing, or lines
    that have to share a speed none.
    """
    made, impossible, unshared = _made(question.to_json())
    if impossible:
        first, more = impossible[0], len(impossible) - 1
        line = made.program.lines[first.at].line + 1
        said = f"line {line}: {first.why}{_leaves(made, question)}"
        raise LimitsError(said + (f" (and {more} more lines)" if more else ""))
    if unshared:
        raise LimitsError(unshared)
    return made


def _leaves(made: Problem, question: Question) -> str:
    """Return what keeping the force limit with a probability leaves of it: the figure that a refusal compares with."""
    asked = limits_of(made.program.machine, question.force_limit_n).force_n
    if question.margin == 1.0 or asked is None:
        return ""
    return f"; {asked:g} N kept with a probability of {question.probability:g} leave {asked / question.margin:.3g} N"


@lru_cache(maxsize=4)
def _made(text: str) -> tuple[Problem, tuple[Impossible, ...], str]:
    question = Question.from_json(text)
    machine = machine_from_toml(question.machine_toml)
    check_tools(machine)
    check_effects(machine)
    limits = limits_of(machine, question.force_limit_n)
    if limits.force_n is not None:
        limits = limits.model_copy(update={"force_n": limits.force_n / question.margin})
    if question.objective is not Objective.TIME and machine.cost is None:
        raise OptimisationError(
            f"no [cost]: --objective {question.objective} needs what a second and a tool cost (docs/how-to/optimise.md)"
        )
    read = _read(json.dumps([question.program_text, question.machine_toml, question.planned, question.left_alone]))
    economy = Economy.of(machine.cost) if machine.cost is not None else None
    control = control_of(machine)
    left, impossible = allowed(read, CutForces.of(read), limits, control.feed_ratio)
    changes = SpeedChanges.PER_TOOL if read.dialect.speed_per_tool else question.speed_changes
    left, groups, unshared = speed_groups(read, left, changes)
    return Problem(read, left, groups, economy, control), impossible, unshared


@lru_cache(maxsize=2)
def _read(text: str) -> Programmed:
    """The program and its cuts, which take the longest to work out: once for all margins."""
    program_text, machine_toml, planned, left_alone = json.loads(text)
    cuts = None if planned is None else {int(line): rows for line, rows in planned.items()}
    alone = {int(line): why for line, why in left_alone.items()}
    return programmed(machine_from_toml(machine_toml), program_text, engagement=cuts, left_alone=alone)


def single(objective: Objective) -> Objective:
    """Return the objective that a line by itself is best by: of a front, the cost."""
    return Objective.COST if objective is Objective.PARETO else objective
