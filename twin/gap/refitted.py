"""The machine that a hypothesis describes: constants refitted, effects added, ready to be used wherever a `machine.toml` is."""

from collections.abc import Iterable

import numpy as np

from twin.gap.axis_stage import AxisStage
from twin.gap.diagnosis import Effected
from twin.gap.fitting import Fitted
from twin.gap.stage import Stage
from twin.identification.axis_parameters import AxisParameter, identified_axis
from twin.machine import AddedEffect, MachineFile


def with_constants(machine: MachineFile, stage: Stage, found: Fitted) -> MachineFile:
    """The machine with the constants of one stage as they were fitted."""
    count = len(found.model.constants)
    theta = found.theta[:count]
    if isinstance(stage, AxisStage):
        parameters = tuple(AxisParameter(p.name, "", True, p.sigma) for p in found.model.constants)
        axis = identified_axis(machine.axes[stage.letter], parameters, theta)
        return machine.model_copy(update={"axes": dict(machine.axes) | {stage.letter: axis}})
    for free, value in zip(found.model.constants, theta, strict=True):
        section, _, key = free.name.partition(".")
        table = getattr(machine, section)
        changed = getattr(table, key) * float(np.exp(value))
        if key == "efficiency":
            changed = min(changed, 1.0)
        machine = machine.model_copy(update={section: table.model_copy(update={key: changed})})
    return machine


def with_effects(machine: MachineFile, added: Iterable[tuple[Effected, dict[str, float]]]) -> MachineFile:
    """The machine with these effects in it; a limit or stiffness that came out infinite is no effect."""
    effects = list(machine.effects)
    for effected, values in added:
        if all(np.isfinite(v) for v in values.values()):
            parameters = {k: float(f"{v:.8g}") for k, v in values.items()}
            effects.append(AddedEffect(effect=effected.effect, on=effected.on, parameters=parameters))
    return machine.model_copy(update={"effects": tuple(effects)})
