"""The effects that a machine has already, by the quantities that they change."""

from collections.abc import Collection, Mapping

from twin.effects.catalogue import effect_named
from twin.machine import MachineFile


def added_effects(machine: MachineFile, known: Collection[str], on: str = "") -> dict[str, Mapping[str, float]]:
    """The effects of a machine that change one of the `known` quantities of a stage, name → parameters.

    on: the axis or the signal that they are put on; empty for the machine as a whole
    """
    stage = set(known)
    return {e.effect: e.parameters for e in machine.effects if e.on == on and stage & set(effect_named(e.effect).changes)}
