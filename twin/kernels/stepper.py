"""A stage of the simulator as a plain function of one sample: the same woven text that its kernels are compiled from.

    step(*fed, *states) -> (*gives, *states)

Constants of the machine and parameters of effects are bound once. Nothing is compiled, so that a live processor needs no numba,
and numbers are numbers, so that it needs no numpy.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect
from twin.kernels import elementary
from twin.kernels.assembly import Assembly, Scalars, kernel_text
from twin.kernels.generated import in_python
from twin.kernels.weave import function_text, weave

Parameters = Mapping[str, Mapping[str, float]]
"""Effect → its parameters, as a machine states them (`twin.effects.added.added_effects`)."""
Step = Callable[..., tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class Stepper:
    """A stage, ready to be called.

    states: of the effects, name → number or quantity that it starts from, in the order in which `step` takes and returns them
    reads: the fed quantities that the stage reads, after effects
    """

    step: Step
    states: Mapping[str, float | str]
    reads: frozenset[str]

    def start(self, quantities: Mapping[str, float]) -> tuple[float, ...]:
        """Return the states at their declared start, by the quantities that they start from."""
        return tuple(quantities[start] if isinstance(start, str) else start for start in self.states.values())


@dataclass(frozen=True, slots=True)
class Stage:
    """A stage of the simulator, as it is stepped.

    fed: quantities that a caller gives, in order; gives: those that it is given back
    calls: functions of the physics that are not woven but called
    """

    assembly: Assembly
    fed: tuple[str, ...]
    gives: tuple[str, ...]
    calls: tuple[Callable[..., object], ...] = ()

    def stepper(self, constants: Mapping[str, float], effects: Parameters, added: str = "") -> Stepper:
        """Return the stage of a machine with these effects. Raises EffectError where one does not fit.

        added: a quantity on top of which the caller gives something as `added__<quantity>`, after those that are fed
        """
        acting = self.assembly.effects(effects)
        given = {f"{one.name}__{key}": value for one in acting for key, value in one.checked(effects[one.name]).items()}
        text, names, states, reads = _woven(self, acting, added)
        make = in_python(text)["stepper"]
        return Stepper(make(*self.assembly.taken({**constants, **given}, names)), states, reads)


@cache
def _woven(
    stage: Stage, effects: tuple[Effect, ...], added: str
) -> tuple[str, tuple[str, ...], Mapping[str, float | str], frozenset[str]]:
    """Return the text, the constants that `stepper` takes in it, the states, and the fed quantities that it reads."""
    woven = weave(stage.assembly.physics, effects, (), (added,) if added else ())
    fed = (*stage.fed, *((f"added__{added}",) if added else ()))
    scalars = Scalars.of(woven, effects, fed)
    changed = [name for name in scalars.constants if name in woven.sets]
    lines = [
        f"def stepper({', '.join(f'given__{name}' if name in changed else name for name in scalars.constants)}):",
        f"    def step({', '.join((*fed, *scalars.states))}):",
        *(f"        {name} = given__{name}" for name in changed),
        *(f"        {line}" for line in woven.body.splitlines()),
        f"        return {', '.join((*stage.gives, *scalars.states))},",
        "    return step",
    ]
    functions = [function_text(f) for f in (elementary.exp_of_minus, elementary.sine_of_turns, *stage.calls)] + [*woven.functions]
    text = kernel_text("from math import exp, sqrt", functions, ["\n".join(lines)])
    return text, scalars.constants, scalars.states, frozenset(woven.takes)


def sentences(effects: Parameters) -> tuple[str, ...]:
    """Return each effect in words, as a basis says it.

    >>> sentences({"rated_power": {"scale": 1.3}})
    ('with rated_power scale 1.3',)
    """
    return tuple(
        f"with {name} " + ", ".join(f"{key} {value:g}" for key, value in effect_named(name).checked(given).items())
        for name, given in effects.items()
    )
