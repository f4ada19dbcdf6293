"""The effects that a machine has already, by the quantities that they change; and whether they fit it."""

import re
from collections.abc import Collection, Mapping

from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.errors import EffectError
from twin.learned.placement import check_terms
from twin.machine import MachineFile
from twin.sites import Site

SIGNAL = re.compile(r"^([a-z][a-z0-9]?_(pos_mm|table_mm|torque_a)|force_[xy]_n|spindle_load_pct|spindle_temp_c)$")


def added_effects(machine: MachineFile, known: Collection[str], on: str = "") -> dict[str, Mapping[str, float]]:
    """The effects of a machine that change one of the `known` quantities of a stage, name → parameters.

    on: the axis or the signal that they are put on; empty for the machine as a whole
    """
    stage = set(known)
    return {e.effect: e.parameters for e in machine.effects if e.on == on and stage & set(effect_named(e.effect).changes)}


def check_effects(machine: MachineFile) -> None:
    """Raises EffectError where an effect of the machine is unknown, out of bounds, doubled, or put on what there is not."""
    seen: set[tuple[str, str]] = set()
    for added in machine.effects:
        effect = effect_named(added.effect)
        effect.checked(added.parameters)
        if (added.effect, added.on) in seen:
            raise EffectError(f"{added.effect} on {added.on or 'the machine'} is there twice; add its parameters up")
        seen.add((added.effect, added.on))
        if effect.on is On.AXIS and not added.on:
            raise EffectError(f"{added.effect} acts on an axis: say which by `on`")
        if effect.on is On.AXIS and added.on not in machine.axes:
            raise EffectError(f"{added.effect} is put on {added.on!r}, which is no axis; there are {', '.join(machine.axes)}")
        of_a_tool = machine.tools if effect.site is Site.PROCESS_FORCE else {}
        if effect.on is On.MACHINE and added.on and added.on not in of_a_tool:
            tools = f", or the number of a tool ({', '.join(of_a_tool)})" if of_a_tool else ""
            raise EffectError(f"{added.effect} is put on {added.on!r}; it acts on the machine as a whole: `on` is empty{tools}")
        if effect.on is On.SIGNAL and not added.on:
            raise EffectError(f"{added.effect} acts on a signal: say which by `on`")
        if effect.on is On.SIGNAL and not SIGNAL.match(added.on):
            raise EffectError(
                f"{added.effect} is put on {added.on!r}, which is no column that a machine answers with (x_pos_mm, …)"
            )
    check_terms(machine.learned, machine.axes)
