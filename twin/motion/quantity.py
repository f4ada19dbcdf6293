"""One quantity of the control as the effects of a machine change it (site `program`), worked out without a planner.

An effect changes a quantity by a plain function of it and of the effect's parameters: `twin.motion.control` applies all of
them before it plans, and who needs a single one, such as the length of a tool change, finds it here.
"""

import inspect
from collections.abc import Mapping
from functools import cache

from twin.effects.catalogue import effect_named
from twin.effects.effect import Change, Effect
from twin.machine import MachineFile
from twin.sites import Site


def changed_quantity(machine: MachineFile, quantity: str, stated: float) -> float:
    """Return a quantity of the control that is `stated` so, with the effects of the machine on it.

    >>> from twin.machine import machine_from_toml
    >>> head = '[machine]\\nname = "vmc"\\n[[effects]]\\n'
    >>> machine = machine_from_toml(head + 'effect = "tool_change_time"\\nparameters = { change_s = 1.5 }')
    >>> changed_quantity(machine, "tool_change_s", 6.0)
    7.5

    Raises EffectError where an effect is unknown or a parameter is out of its bounds.
    """
    value = stated
    for added in machine.effects:
        effect = effect_named(added.effect)
        if effect.site is Site.PROGRAM and quantity in effect.changes:
            value = change_of(effect, quantity, value, effect.checked(added.parameters))
    return value


def change_of(effect: Effect, quantity: str, value: float, given: Mapping[str, float]) -> float:
    """Return the value of a quantity after an effect with these parameters."""
    function = effect.changes[quantity]
    changed = function(value, *(given[name] for name in _arguments(function)))
    assert isinstance(changed, float | int), "a quantity of the control is one number"
    return float(changed)


@cache
def _arguments(function: Change) -> tuple[str, ...]:
    """Return the arguments that a change takes besides the quantity."""
    return tuple(inspect.signature(function).parameters)[1:]
