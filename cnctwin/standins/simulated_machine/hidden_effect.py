"""The hidden effect: one that the simulated machine has and its twin was not told of, sealed until somebody opens the seal.

`hidden_effects.toml` holds the effects that production signals show within minutes, with the range of their sizes. The hidden one
stands in one file, which the machine itself writes. The hash of that file is shown from the start, so that anybody who sees the
effect later can check that it has not been changed meanwhile.
"""

import json
import tomllib
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict

from cnctwin.errors import UsageError
from cnctwin.files.sealed import Sealed, read_sealed, seal, write_sealed
from twin.effects.catalogue import effect_named
from twin.gap.units import unit_on
from twin.machine import AddedEffect

EFFECTS = Path(__file__).with_name("hidden_effects.toml")
RANDOM = "random"
DIGITS = 3
"""The digits of a size that is drawn."""


class HiddenEffect(BaseModel):
    """An effect that can be hidden.

    size: the parameter that is drawn, with its lowest and highest value; parameters: the others
    at_random: it is among those that are drawn where nobody chooses: the loop finds it within three minutes
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: str
    on: str = ""
    size: dict[str, tuple[float, float]]
    parameters: dict[str, float] = {}
    at_random: bool = True

    @property
    def name(self) -> str:
        """The name that a person chooses it by.

        >>> HiddenEffect(effect="bend", on="z", size={"mm": (1.0, 2.0)}).name
        'bend@z'
        """
        return f"{self.effect}@{self.on}" if self.on else self.effect

    def of_size(self, size: float) -> AddedEffect:
        """Return the effect of one size. Raises EffectError where a machine cannot have that."""
        (parameter,) = self.size
        values = effect_named(self.effect).checked({parameter: size, **self.parameters})
        return AddedEffect(effect=self.effect, on=self.on, parameters=values)

    def drawn(self, random: Random) -> AddedEffect:
        """Return the effect of a size within its range."""
        ((low, high),) = self.size.values()
        return self.of_size(float(f"{random.uniform(low, high):.{DIGITS}g}"))


class Choice(NamedTuple):
    """A person's choice of a hidden effect: `random`, or one by its name, of a size or of one that is drawn."""

    effect: HiddenEffect | None
    size: float | None = None

    def added(self, seed: int | None) -> AddedEffect:
        """Return the effect that this choice comes to. seed: None = another one each time"""
        random = Random(seed)  # noqa: S311 — a demonstration, no secret
        effect = self.effect or random.choice([one for one in hidden_effects() if one.at_random])
        return effect.drawn(random) if self.size is None else effect.of_size(self.size)


@cache
def hidden_effects() -> tuple[HiddenEffect, ...]:
    """Return the effects that can be hidden, in the order of their file."""
    table = tomllib.loads(EFFECTS.read_text(encoding="utf-8"))
    return tuple(HiddenEffect.model_validate(entry) for entry in table["effects"])


def choice_of(text: str) -> Choice:
    """Return the choice that `NAME`, `NAME@SIGNAL`, either with `:SIZE`, or `random` stands for. Raises UsageError."""
    name, colon, size = text.partition(":")
    if text == RANDOM:
        return Choice(None)
    found = [effect for effect in hidden_effects() if name in (effect.name, effect.effect)]
    if not found:
        known = ", ".join(effect.name for effect in hidden_effects())
        raise UsageError(f"--effect {name!r} does not show within minutes; choose {RANDOM} or one of {known}")
    try:
        choice = Choice(found[0], float(size) if colon else None)
        choice.added(0)
    except ValueError as error:
        raise UsageError(f"--effect {text}: {error if str(error).startswith(name) else f'{size!r} is no size'}") from None
    return choice


def sealed_effect(choice: Choice, seed: int | None, file: Path | None) -> tuple[AddedEffect, Sealed]:
    """Return the effect and its seal: those of `file` where the machine was started before, else drawn and kept there."""
    if file is not None and file.exists():
        sealed = read_sealed(file)
        return AddedEffect.model_validate(json.loads(sealed.text)["added"]), sealed
    added = choice.added(seed)
    sealed = seal(json.dumps(statement(added), sort_keys=True))
    if file is not None:
        write_sealed(sealed, file)
    return added, sealed


def statement(added: AddedEffect) -> dict[str, Any]:
    """Return what is sealed: the effect as a machine file has it, in words, and the units of its parameters."""
    effect = effect_named(added.effect)
    known = {parameter.name: parameter for parameter in effect.parameters}
    shown = {
        name: {"value": value, "unit": unit_on(known[name].unit, added.on), "meaning": known[name].meaning}
        for name, value in added.parameters.items()
        if value != known[name].null
    }
    return {"added": added.model_dump(), "equation": effect.equation, "parameters": shown}
