"""An effect of the reference machine: what it is put on, how it is drawn and scaled, and what it does to the physics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cnctwin.standins.reference_machine.physics import Physics

Chance = np.random.Generator
Parameters = Mapping[str, float]
AXES = ("x", "y", "z")
"""Axes that move in a cut."""


@dataclass(frozen=True, slots=True)
class ActsAt:
    """A place where an effect acts and what it depends on there, in the words of formats, section 6.

    >>> ActsAt.from_text("axis_force: position direction") == ActsAt("axis_force", frozenset({"direction", "position"}))
    True
    """

    site: str
    depends_on: frozenset[str]

    @classmethod
    def from_text(cls, text: str) -> "ActsAt":
        """Read `site: word word`."""
        site, _, words = text.partition(":")
        return cls(site, frozenset(words.split()))


Described = Callable[[str, Parameters], tuple[ActsAt, ...]]
"""A function of the effect's place and its parameters that returns the descriptions of it that are equally right."""


def described(*texts: str) -> Described:
    """Return the same descriptions wherever the effect is."""
    alternatives = tuple(ActsAt.from_text(text) for text in texts)
    return lambda _on, _parameters: alternatives


UNDESCRIBED = described()


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect.

    name: of the catalogue (formats, section 7), or of this machine's own
    places: what it can be put on, axis letters or columns; ("",) = the machine
    kinds: of runs that show it; warm: only where the spindle turns in air and its temperature is recorded
    traits: draws what does not depend on its size (a phase, a place, a sign)
    parameters: of an amplitude (1 = what a machine tool shows) and the traits, under the catalogue's names
    acts: the physics with it
    most, least: the largest amplitude that makes sense, and the smallest that the steps of the integration can follow
    exact: parameters that mean here what they mean in the catalogue
    in_controller: it changes what the control computes
    acts_at: the descriptions of an effect of no catalogue that are right
    """

    name: str
    places: tuple[str, ...]
    kinds: tuple[str, ...]
    traits: Callable[[Chance], Parameters]
    parameters: Callable[[float, Parameters], Parameters]
    acts: Callable[[Physics, str, Parameters], Physics]
    most: float = 30.0
    exact: tuple[str, ...] = ()
    warm: bool = False
    least: float = 1e-4
    in_controller: bool = False
    acts_at: Described = UNDESCRIBED


def none(_: Chance) -> Parameters:
    """No traits."""
    return {}


def sign(chance: Chance) -> Parameters:
    """A sign."""
    return {"sign": float(chance.choice([-1.0, 1.0]))}


def phase(chance: Chance) -> Parameters:
    """An angle."""
    return {"phase_rad": float(chance.uniform(0.0, 2.0 * np.pi))}


def between(**ranges: tuple[float, float]) -> Callable[[Chance], Parameters]:
    """Draws each name evenly from its range."""
    return lambda chance: {name: float(chance.uniform(low, high)) for name, (low, high) in ranges.items()}
