"""Writes a question as a case folder (formats, section 5): what the machine states, and what it did.

Runs that are not in the folder, for judging a diagnosis on what it has never seen, go into one of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w

from cnctwin.blind_check.answer import Answer, Answered
from cnctwin.blind_check.question import DrawnEffect, Question, effect_on, structure_named
from cnctwin.standins.reference_machine.effect import Parameters
from cnctwin.standins.reference_machine.physics import Physics, physics_of
from cnctwin.standins.reference_machine.program import air_program, cut_program, nc_text
from cnctwin.standins.reference_machine.recording import (
    Columns,
    Motion,
    WarmUp,
    motion_of,
    motion_run,
    warmup_of,
    warmup_run,
    write,
)
from cnctwin.standins.reference_machine.size import amplitude_for, rms_by_signal, sizes
from cnctwin.standins.reference_machine.stated import MachineFigures, drawn_machine, machine_toml, scattered
from cnctwin.standins.reference_machine.trajectory import Dynamics

FIT, REPEAT, CHECK, UNSEEN = 1, 2, 3, 4
"""Seeds of the chances of each run; a fit and its repeat are runs of one program."""
Course = Motion | WarmUp
"""The motion that a program makes, or a warm-up."""


@dataclass(frozen=True, slots=True)
class Machine:
    """The machine of a question.

    stated: its figures as it states them; healthy: what it is without the effects that are asked; nominal: the same with the
    controller that it states; courses: of its programs
    """

    question: Question
    stated: MachineFigures
    healthy: Physics
    nominal: Physics
    courses: Mapping[tuple[str, int], Course]


def machine_of(question: Question) -> Machine:
    """Draws the machine and its programs; fit and repeat share one, check and unseen have their own. No warm-up is repeated."""
    chance = np.random.default_rng([question.seed, 2])
    stated = drawn_machine(chance)
    healthy = physics_of(scattered(stated, chance))
    dynamics = Dynamics(float(chance.uniform(1800.0, 2800.0)), float(chance.uniform(0.025, 0.06)))
    courses: dict[tuple[str, int], Course] = {}
    for kind in question.kinds:
        for run in (FIT, CHECK, UNSEEN):
            courses[kind, run] = _drawn(kind, stated, dynamics, question.warm, chance)
        courses[kind, REPEAT] = _drawn(kind, stated, dynamics, question.warm, chance) if kind == "warmup" else courses[kind, FIT]
    restless = replace(healthy, disturbance_n=float(chance.uniform(0.7, 1.3)), disturbance_s=float(chance.uniform(0.03, 0.08)))
    return Machine(question, stated, _controlled(question, restless), restless, courses)


def _controlled(question: Question, physics: Physics) -> Physics:
    """The physics with the controller of the question."""
    structure = question.controller
    if structure is None:
        return physics
    return structure_named(structure.effect).acts(physics, structure.on, _structure_parameters(question))


def _structure_parameters(question: Question) -> Parameters:
    assert question.controller is not None
    structure = structure_named(question.controller.effect)
    return structure.parameters(1.0, structure.traits(np.random.default_rng([question.seed, 5])))


def _drawn(kind: str, stated: MachineFigures, dynamics: Dynamics, warm: bool, chance: np.random.Generator) -> Course:
    if kind == "warmup":
        return warmup_of(chance)
    if kind == "cut":
        return motion_of(cut_program(chance, stated.tool.teeth, stated.tool.tangential_coefficient_n_per_mm2), dynamics, chance)
    return motion_of(air_program(chance, float(chance.uniform(5000.0, 9000.0)) if warm else None), dynamics, chance)


def recorded(machine: Machine, physics: Physics, kind: str, run: int, axes: str = "xyz", *, seed: int | None = None) -> Columns:
    """Return the recording of a run of the machine with `physics`; another seed gives other chances."""
    told = machine.courses[kind, run]
    number = int(np.random.default_rng([machine.question.seed, 3, run if seed is None else seed]).integers(2**31))
    return warmup_run(physics, told, number) if isinstance(told, WarmUp) else motion_run(physics, told, number, axes)


Floors = Mapping[str, Mapping[str, float]]
"""Kind of run → signal → what healthy runs differ by."""


def with_effects(machine: Machine, floors: Floors) -> tuple[Physics, tuple[Answered, ...]]:
    """The machine's physics with its effects, each scaled alone to its target on the fit runs; and what they are."""
    chance = np.random.default_rng([machine.question.seed, 4])
    physics, answered = machine.healthy, []
    for asked in machine.question.asked:
        effect = effect_on(asked)
        traits = effect.traits(chance)
        kinds = [kind for kind in machine.question.kinds if kind in effect.kinds]
        parameters = effect.parameters(_amplitude(machine, asked, traits, kinds, floors), traits)
        alone = effect.acts(machine.healthy, asked.on, parameters)
        size = _size(machine, alone, dict.fromkeys(kinds, (FIT, CHECK)), floors, _moved(asked))
        answered.append(Answered(asked.effect, asked.on, asked.named, dict(parameters), effect.exact, size))
        physics = effect.acts(physics, asked.on, parameters)
    return physics, tuple(answered)


def physics_with(machine: Machine, answer: Answer) -> Physics:
    """The machine's physics with the effects of an answer, whose sizes need not be searched for again."""
    physics = machine.healthy
    for effect in answer.effects:
        asked = DrawnEffect(effect.effect, effect.on, 0.0, effect.named)
        physics = effect_on(asked).acts(physics, effect.on, effect.stated)
    return physics


def _moved(asked: DrawnEffect) -> str:
    """The axes whose signals the effect changes: its own, or any."""
    return asked.on if asked.on in ("x", "y", "z") else "xyz"


def _floors(machine: Machine, kind: str) -> dict[str, float]:
    """Return what healthy runs of the fit program differ by, over √2: three of them, as two can agree by luck."""
    one, other, third = (recorded(machine, machine.healthy, kind, FIT, seed=seed) for seed in (FIT, 10, 11))
    differ = rms_by_signal([one, other, third], [other, third, one])
    return {name: value / np.sqrt(2.0) for name, value in differ.items()}


def _amplitude(
    machine: Machine,
    asked: DrawnEffect,
    traits: Parameters,
    kinds: list[str],
    floors: Floors,
) -> float:
    """The amplitude at which the largest signal of a fit run has the size that is asked for."""
    effect, axes = effect_on(asked), _moved(asked)
    healthy = {kind: recorded(machine, machine.healthy, kind, FIT, axes) for kind in kinds}

    def size_of(amplitude: float) -> float:
        changed = effect.acts(machine.healthy, asked.on, effect.parameters(amplitude, traits))
        found = 0.0
        for kind in kinds:
            differs = rms_by_signal([recorded(machine, changed, kind, FIT, axes)], [healthy[kind]])
            found = max(found, *sizes(differs, floors[kind]).values(), 0.0)
        return found

    return amplitude_for(asked.target, size_of, effect.most, effect.least)


def _size(
    machine: Machine,
    physics: Physics,
    runs: Mapping[str, tuple[int, ...]],
    floors: Floors,
    axes: str,
    *,
    bare: Physics | None = None,
) -> dict[str, float]:
    """Signal → size over the floor beside `bare` (the healthy machine), the larger where runs of two kinds show it."""
    bare = machine.healthy if bare is None else bare
    found: dict[str, float] = {}
    for kind, numbers in runs.items():
        changed = [recorded(machine, physics, kind, run, axes) for run in numbers]
        healthy = [recorded(machine, bare, kind, run, axes) for run in numbers]
        for name, size in sizes(rms_by_signal(changed, healthy), floors[kind]).items():
            found[name] = max(found.get(name, 0.0), round(size, 3))
    return found


def answer_of(question: Question) -> Answer:
    """The answer to a question: what its effects are, and how large."""
    machine = machine_of(question)
    floors = {kind: _floors(machine, kind) for kind in question.kinds if question.asked}
    physics, effects = with_effects(machine, floors)
    together = effects[0].size_over_floor if len(effects) == 1 else {}
    if len(effects) > 1:
        together = _size(machine, physics, dict.fromkeys(question.kinds, (FIT, CHECK)), floors, "xyz")
    return Answer(question.name, question.sort, effects, together, _controller(machine, floors))


def _controller(machine: Machine, floors: Floors) -> Answered | None:
    """The structure of the controller where it is not the stated one, and how much of a gap it is by itself."""
    structure = machine.question.controller
    if structure is None:
        return None
    kinds = [kind for kind in machine.question.kinds if kind in structure_named(structure.effect).kinds]
    size = _size(machine, machine.healthy, dict.fromkeys(kinds, (FIT, CHECK)), floors, structure.on, bare=machine.nominal)
    return Answered(structure.effect, structure.on, True, dict(_structure_parameters(machine.question)), (), size)


def write_case(folder: Path, question: Question, answer: Answer | None = None) -> Answer:
    """Writes the case of a question into `folder`, which is made, and returns its answer, which is worked out where not given."""
    answer = answer_of(question) if answer is None else answer
    machine = machine_of(question)
    runs = [(kind, run) for kind in question.kinds for run in (FIT, REPEAT, CHECK)]
    write_folder(folder, machine, physics_with(machine, answer), runs)
    return answer


def check_runs(question: Question, answer: Answer) -> None:
    """Record each run of a question once. Raises ValueError where a reading is no number, and whatever the physics raises."""
    machine = machine_of(question)
    physics = physics_with(machine, answer)
    for kind in question.kinds:
        for run in (FIT, REPEAT, CHECK, UNSEEN):
            for name, values in recorded(machine, physics, kind, run).items():
                if np.isinf(values).any() or np.isnan(values).all():
                    raise ValueError(f"{question.name}: {name} of the {kind} run is not finite")


NAMES = {FIT: "fit", REPEAT: "fit_2", CHECK: "check", UNSEEN: "check"}


def write_folder(folder: Path, machine: Machine, physics: Physics, runs: list[tuple[str, int]]) -> None:
    """Write the case of a machine with `physics` whose runs are these; the folder is made."""
    (folder / "runs").mkdir(parents=True)
    (folder / "machine.toml").write_text(machine_toml(machine.stated), encoding="utf-8")
    entries = []
    for kind, run in runs:
        stem = f"runs/{kind}_{NAMES[run]}"
        write(recorded(machine, physics, kind, run), folder / f"{stem}.parquet")
        entry = {"file": f"{stem}.parquet", "kind": kind, "role": "fit" if run in (FIT, REPEAT) else "check"}
        told = machine.courses[kind, run]
        if isinstance(told, Motion):
            (folder / f"{stem}.nc").write_text(nc_text(told.blocks), encoding="utf-8")
            entry["program"] = f"{stem}.nc"
            if run == REPEAT:
                entry["repeats"] = f"runs/{kind}_fit.parquet"
        entries.append(entry)
    case = {"case": {"name": machine.question.name, "machine": "machine.toml"}, "runs": entries}
    (folder / "case.toml").write_text(tomli_w.dumps(case), encoding="utf-8")
