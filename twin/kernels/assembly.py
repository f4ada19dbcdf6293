"""The assembly of a stage's kernel: the effects that act in it, the constants that it takes, its text, and the function to call.

Servo, process, spindle, heat and sensor are assembled here; each brings its physics and the loop around it. Their functions take
numbers and arrays, no named tuples: numba keeps a compiled function with the types of its arguments under the hash of the text,
which would stay the same where the class of a tuple changes or moves.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeVar

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.kernels.generated import compiled, in_python
from twin.kernels.weave import Physics, Woven, quantities

KERNEL = "@njit(cache=True, nogil=True, error_model='numpy')"
"""Stands before a function that is called from outside the generated text; the others need less."""
INNER = "@njit(error_model='numpy')"
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True)
class Assembly:
    """The physics of a stage, and two names for its messages.

    acts_on: completes "the effect does not act on …"; owner: completes "the constant … of … is missing"
    """

    physics: tuple[Physics, ...]
    acts_on: str
    owner: str

    def quantities(self) -> dict[str, str]:
        """Return the quantities that an effect can change or a recording replace, with the site of each."""
        return _quantities(self.physics)

    def effects(self, names: Iterable[str]) -> tuple[Effect, ...]:
        """Return the effects of these names. Raises EffectError where one does not exist or does not act in this stage."""
        known = set(self.quantities())
        acting = tuple(effect_named(name) for name in names)
        for effect in acting:
            if not set(effect.changes) & known:
                raise EffectError(f"{effect.name} does not act on {self.acts_on}; it acts at the {effect.site} site")
        return acting

    def taken(self, constants: Mapping[str, Value], names: Iterable[str]) -> list[Value]:
        """Return the constants of these names, in their order. Raises EffectError naming the first one that is missing."""
        taken = []
        for name in names:
            if name not in constants:
                raise EffectError(f"the constant {name} of {self.owner} is missing")
            taken.append(constants[name])
        return taken


@cache
def _quantities(physics: tuple[Physics, ...]) -> dict[str, str]:
    return quantities(physics)


@dataclass(frozen=True, slots=True)
class Scalars:
    """The constants and states of a kernel that runs one lane through a series.

    constants: names, in the order of the array `constants`; states: of the effects, name → number or quantity to start from
    """

    constants: tuple[str, ...]
    states: Mapping[str, float | str]

    @classmethod
    def of(cls, woven: Woven, effects: Iterable[Effect], fed: Iterable[str]) -> "Scalars":
        """Return those that the woven text reads; the loop feeds it the quantities `fed`."""
        states = {f"{effect.name}__{name}": value for effect in effects for name, value in effect.states.items()}
        states = {name: value for name, value in states.items() if name in woven.takes}
        fed = {*fed, *states}
        return cls(tuple(name for name in woven.takes if name not in fed), states)

    def before_loop(self) -> list[str]:
        """Return the lines that read the constants, once."""
        return [f"given__{name} = constants[{row}]" for row, name in enumerate(self.constants)]

    def states_at_start(self) -> list[str]:
        """Return the lines that set the states, once."""
        return [f"{name} = {value}" for name, value in self.states.items()]

    def in_loop(self) -> list[str]:
        """Return the lines that set the constants at every sample, since an effect may have changed them at the one before."""
        return [f"{name} = given__{name}" for name in self.constants]


def kernel_text(imports: str, functions: Iterable[str], kernels: Iterable[str]) -> str:
    """Return the text of a module: the imports, the functions that the kernels call, and the kernels."""
    return "\n\n\n".join([imports, *(f"{INNER}\n{text}" for text in functions), *kernels]) + "\n"


def kernel_function(text: str, name: str, *, reference_run: bool) -> Callable[..., None]:
    """Return the function `name` of the text: compiled, or interpreted where this is a reference run.

    Its arguments are numbers and arrays of one dimension, some of which it fills.
    """
    if reference_run:
        return partial(_interpreted, in_python(text)[name])
    function: Callable[..., None] = getattr(compiled(text), name)
    return function


def _interpreted(function: Callable[..., None], *arguments: Any) -> None:
    """Call the function with lists in place of arrays, which Python goes through faster, and copy back what it wrote."""
    given = [argument.tolist() if hasattr(argument, "tolist") else argument for argument in arguments]
    lists = [list(one) if isinstance(one, list) else one for one in given]
    function(*lists)
    for argument, before, after in zip(arguments, given, lists, strict=True):
        if hasattr(argument, "tolist") and after != before:
            argument[...] = after
