"""A question of the blind check: which runs of a reference machine, and which effects it has. Drawn by seed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from cnctwin.standins.reference_machine.controllers import STRUCTURES
from cnctwin.standins.reference_machine.effect import Effect
from cnctwin.standins.reference_machine.named_effects import NAMED
from cnctwin.standins.reference_machine.unnamed_effects import UNNAMED

Chance = np.random.Generator
SIZES = (0.7, 30.0)
"""Smallest and largest size of an effect over the floor; drawn evenly over its logarithm."""
KINDS = ("air", "cut", "warmup")
OTHER_CONTROLLERS = 1.0 / 3.0
"""Share of cases whose machine has another structure of controller than it states."""


class Sort(StrEnum):
    """The number of effects that a machine has, and whether they are in the catalogue."""

    SINGLE = "single"
    PAIR = "pair"
    TRIPLE = "triple"
    HEALTHY = "healthy"
    OUTSIDE = "outside"


SHARES = {Sort.SINGLE: 0.35, Sort.PAIR: 0.2, Sort.TRIPLE: 0.05, Sort.HEALTHY: 0.2, Sort.OUTSIDE: 0.2}
COUNT = {Sort.SINGLE: 1, Sort.PAIR: 2, Sort.TRIPLE: 3, Sort.HEALTHY: 0, Sort.OUTSIDE: 1}


@dataclass(frozen=True, slots=True)
class DrawnEffect:
    """An effect by name, what it is on, and how large its largest signal shall be over the floor."""

    effect: str
    on: str
    target: float
    named: bool = True


@dataclass(frozen=True, slots=True)
class Structure:
    """The structure of an axis' controller where it is not the nominal one: its name, and the axis."""

    effect: str
    on: str


@dataclass(frozen=True, slots=True)
class Question:
    """seed: of machine, programs, chances; kinds: of runs; warm: the spindle turns in air, its temperature is recorded."""

    name: str
    sort: Sort
    seed: int
    kinds: tuple[str, ...]
    asked: tuple[DrawnEffect, ...]
    warm: bool = False
    controller: Structure | None = None


@dataclass(frozen=True, slots=True)
class Draft:
    """A question by its seed, from which it is drawn, or drawn again with a later seed where it came to nothing.

    effect: which one it asks first, None = none; other_controller: give an axis another structure of controller where that shows
    """

    name: str
    sort: Sort
    seed: int
    effect: str | None
    other_controller: bool = False


def effect_on(asked: DrawnEffect) -> Effect:
    """The effect of the reference machine that is asked for."""
    table = NAMED if asked.named else UNNAMED
    found: list[Effect] = [effect for effect in table if effect.name == asked.effect and asked.on in effect.places]
    assert found, f"there is no {asked.effect} on {asked.on!r}"
    return found[0]


def structure_named(name: str) -> Effect:
    """The structure of a controller by its name."""
    return next(effect for effect in STRUCTURES if effect.name == name)


def names(*, named: bool) -> tuple[str, ...]:
    """The effects there are, each once."""
    return tuple(dict.fromkeys(effect.name for effect in (NAMED if named else UNNAMED)))


def draw(count: int, seed: int, sort: Sort | None = None, effect: str | None = None) -> tuple[Question, ...]:
    """`count` questions in the shares of the protocol, each effect as often as any; of one sort, with one effect, where given."""
    return tuple(question_of(draft) for draft in drafts(count, seed, sort, effect))


def drafts(count: int, seed: int, sort: Sort | None = None, effect: str | None = None) -> tuple[Draft, ...]:
    """Return the questions of `draw`, not drawn yet; other controllers come only among questions of all sorts."""
    chance = np.random.default_rng([seed, 77])
    sorts = [sort] * count if sort else _sorts(count, chance)
    turn = {True: _endless(names(named=True), chance), False: _endless(names(named=False), chance)}
    found = []
    for number, one in enumerate(sorts):
        first = effect or (next_of(turn[one is not Sort.OUTSIDE]) if COUNT[one] else None)
        found.append(Draft(f"case_{number + 1:03d}", one, int(chance.integers(2**31)), first))
    if sort is None:
        can = [i for i, draft in enumerate(found) if _can_have_another(question_of(draft))]
        for i in np.random.default_rng([seed, 78]).permutation(can)[: round(OTHER_CONTROLLERS * count)]:
            found[i] = replace(found[i], other_controller=True)
    return tuple(found)


def question_of(draft: Draft, redraws: int = 0) -> Question:
    """The question of a draft; with each redraw another one of the same sort and the same first effect."""
    question = _question(draft.name, draft.sort, draft.seed + redraws, draft.effect)
    if not draft.other_controller or not _can_have_another(question):
        return question
    chance = np.random.default_rng([question.seed, 6])
    moving = "xyz" if "air" in question.kinds else "xy"
    asked = [effect.on[0] for effect in question.asked if effect.on[:1] in moving and effect.on]
    on = asked[0] if asked else str(chance.choice(list(moving)))
    return replace(question, controller=Structure(STRUCTURES[int(chance.integers(len(STRUCTURES)))].name, on))


def _can_have_another(question: Question) -> bool:
    """Tell whether axes move, and nothing that is asked is in the controller itself; a healthy machine has the one it states."""
    moves = {"air", "cut"} & set(question.kinds)
    return bool(question.asked) and bool(moves) and not any(effect_on(asked).in_controller for asked in question.asked)


def _sorts(count: int, chance: Chance) -> list[Sort]:
    """Shares as exactly as whole numbers allow, in a drawn order."""
    edges = np.round(np.cumsum(list(SHARES.values())) * count).astype(int)
    numbers = np.diff(edges, prepend=0)
    whole = [sort for sort, number in zip(SHARES, numbers, strict=True) for _ in range(number)]
    return [whole[i] for i in chance.permutation(len(whole))]


@dataclass(slots=True)
class _Turn:
    """Deals each name once before any comes again."""

    names: Sequence[str]
    chance: Chance
    left: list[str]


def _endless(all_names: Sequence[str], chance: Chance) -> _Turn:
    return _Turn(all_names, chance, [])


def next_of(turn: _Turn) -> str:
    """The next name."""
    if not turn.left:
        turn.left = [turn.names[i] for i in turn.chance.permutation(len(turn.names))]
    return turn.left.pop()


def _question(name: str, sort: Sort, seed: int, first: str | None) -> Question:
    chance = np.random.default_rng([seed, 1])
    named = sort is not Sort.OUTSIDE
    table = NAMED if named else UNNAMED
    if first is None:
        healthy = KINDS if chance.random() < 0.25 else (str(chance.choice(KINDS)),)
        return Question(name, sort, seed, healthy, (), warm="air" in healthy and chance.random() < 0.2)
    chosen = _one_of([effect for effect in table if effect.name == first], chance)
    kinds = {str(chance.choice(chosen.kinds))} | {kind for kind in KINDS if chance.random() < 0.15}
    warm = chosen.warm or ("air" in kinds and chance.random() < 0.15)
    asked = [_asked(chosen, kinds, chance, named)]
    while len(asked) < COUNT[sort]:
        other = _one_of([e for e in table if set(e.kinds) & kinds and (warm or not e.warm)], chance)
        new = _asked(other, kinds, chance, named)
        if all((new.effect, new.on) != (old.effect, old.on) for old in asked):
            asked.append(new)
    return Question(name, sort, seed, tuple(kind for kind in KINDS if kind in kinds), tuple(asked), warm)


def _one_of(effects: Sequence[Effect], chance: Chance) -> Effect:
    """An effect by its name, then one of those that bear it, so that a sensor's do not outnumber the others."""
    name = str(chance.choice(list(dict.fromkeys(effect.name for effect in effects))))
    bearing = [effect for effect in effects if effect.name == name]
    return bearing[int(chance.integers(len(bearing)))]


def _asked(effect: Effect, kinds: set[str], chance: Chance, named: bool) -> DrawnEffect:
    places = [on for on in effect.places if not (on == "z" and "air" not in kinds)]
    target = float(np.exp(chance.uniform(*np.log(SIZES))))
    return DrawnEffect(effect.name, str(chance.choice(places)), target, named)
