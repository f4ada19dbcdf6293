"""The machine that a hypothesis describes: constants refitted, effects added, ready to be used wherever a `machine.toml` is.

How well it is known goes with it: `[uncertainty]` has one standard deviation, relative, of what the recordings tell.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Cause, Effected
from twin.gap.fitting import Fitted
from twin.gap.intervals import Z90
from twin.gap.stages.axis import AxisStage, axis_constant_path
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.stage import Stage
from twin.identification.axis_parameters import AxisParameter, identified_axis
from twin.machine import AddedEffect, MachineFile

KNOWN_MIN = 0.5
"""Part of what is known of a constant that has to come from the recordings; below it the stated uncertainty stands."""


def with_constants(machine: MachineFile, stage: Stage, found: Fitted) -> MachineFile:
    """The machine with the constants of one stage as they were fitted."""
    count = len(found.model.constants)
    theta = found.theta[:count]
    if isinstance(stage, AxisStage | OpenStage):
        parameters = tuple(AxisParameter(p.name, "", True, p.sigma) for p in found.model.constants)
        axis = identified_axis(machine.axes[stage.letter], parameters, theta)
        return machine.model_copy(update={"axes": dict(machine.axes) | {stage.letter: axis}})
    for free, value in zip(found.model.constants, theta, strict=True):
        section, _, key = free.name.rpartition(".")
        section, _, tool = section.partition(".")
        table = machine.tools[tool] if tool else getattr(machine, section)
        changed = getattr(table, key) * float(np.exp(value))
        if key == "efficiency":
            changed = min(changed, 1.0)
        refitted = table.model_copy(update={key: changed})
        machine = machine.model_copy(update={section: dict(machine.tools) | {tool: refitted} if tool else refitted})
    return machine


def with_effects(machine: MachineFile, added: Iterable[tuple[Effected, dict[str, float]]]) -> MachineFile:
    """The machine with these effects in it; a limit or stiffness that came out infinite is not there."""
    effects = list(machine.effects)
    for effected, values in added:
        parameters = {k: float(f"{v:.8g}") for k, v in values.items() if np.isfinite(v)}
        if not effect_named(effected.effect).is_null(parameters):
            effects.append(AddedEffect(effect=effected.effect, on=effected.on, parameters=parameters))
    return machine.model_copy(update={"effects": tuple(effects)})


def with_uncertainty(machine: MachineFile, deviations: Mapping[str, float], causes: Iterable[Cause]) -> MachineFile:
    """The machine with what is known of its refitted constants and of these causes; all else stays as stated.

    deviations: path → relative standard deviation, of constants
    """
    told = dict(deviations)
    for cause in causes:
        told |= cause_deviations(cause)
    return machine.model_copy(update={"uncertainty": dict(machine.uncertainty) | told})


def constant_deviations(machine: MachineFile, stage: Stage, found: Fitted) -> dict[str, float]:
    """Path → relative standard deviation, of the constants of one stage that the recordings tell."""
    variances = np.diag(found.covariance)
    told = {}
    for free, variance, known in zip(found.model.constants, variances, found.known, strict=False):
        path = constant_path(machine, stage, free.name)
        deviation = _shown(float(np.sqrt(max(variance, 0.0))))  # θ is the logarithm of a factor
        if known >= KNOWN_MIN and 0.0 < deviation < np.inf:
            told[path] = deviation
    return told


def constant_path(machine: MachineFile, stage: Stage, name: str) -> str:
    """Return the path in machine.toml of a free constant of a stage."""
    return axis_constant_path(machine, stage.letter, name) if isinstance(stage, AxisStage | OpenStage) else name


def cause_deviations(cause: Cause) -> dict[str, float]:
    """`effects.<effect>[.<on>].<parameter>` → relative standard deviation, from the 90 % interval.

    What is 0, or has an end at infinity, has none. 400 ± 8 N at 90 % is 8 / 1.645 / 400 of it:

    >>> from twin.gap.diagnosis import Interval
    >>> cause_deviations(Cause("gravity", "z", 1.0, {"force_n": Interval(400.0, 392.0, 408.0, "N")}, (), 1.0))
    {'effects.gravity.z.force_n': 0.0122}
    """
    where = ".".join(("effects", cause.effect, *([cause.on] if cause.on else [])))
    told = {}
    for name, interval in cause.parameters.items():
        width = interval.high - interval.low
        if interval.value and np.isfinite([interval.value, width]).all() and width > 0.0:
            told[f"{where}.{name}"] = _shown(width / 2.0 / Z90 / abs(interval.value))
    return told


def _shown(deviation: float) -> float:
    return float(f"{deviation:.3g}")
