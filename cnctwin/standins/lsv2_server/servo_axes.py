"""The servo axes behind the oscilloscope: the twin's own loops on the simulated machine as it is built, at 0.6 ms.

They go several times through an air program that begins where it ends, and that is shown again and again. It is one run without
its first pass, so an axis that rests at the end of a pass begins the next one, and the first one shown, as it stopped.
"""

from importlib.resources import files

import numpy as np

from cnctwin.standins.lsv2_server.oscilloscope import CHANNELS, LABELS, PERIOD_US, ServoTrace
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import TOLD
from twin.effects.added import check_effects
from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.machine import AddedEffect
from twin.simulator.simulation import simulate

SEED = 530
PASSES = 8
"""Those that are shown, each with noise of its own, so that two recordings of one motion are not the same to the last digit."""
AROUND = ("%", "M30")
"""Lines around a program that stay out where it goes on."""


def told_machine() -> str:
    """Return the machine.toml of what a twin of these axes is told: that of the simulated machine, at the oscilloscope's pace."""
    text, period = TOLD.read_text(encoding="utf-8"), "servo_period_s = 0.001"
    assert text.count(period) == 1, "the simulated machine states its servo period"
    return text.replace(period, f"servo_period_s = {PERIOD_US / 1e6:g}")


def hidden_effect(name: str, axis: str) -> AddedEffect:
    """Return an effect at the size that a machine tool shows. Raises EffectError."""
    effect = effect_named(name)
    return AddedEffect(effect=name, on=axis if effect.on is On.AXIS else "", parameters=effect.typical_values())


def servo_trace(hidden: AddedEffect | None = None, seed: int = SEED) -> ServoTrace:
    """Simulate the passes of the program. hidden: an effect that the description does not tell. Raises EffectError."""
    machine = machine_as_built(hidden)
    machine = machine.model_copy(update={"machine": machine.machine.model_copy(update={"servo_period_s": PERIOD_US / 1e6})})
    check_effects(machine)
    program = files(__package__).joinpath("air.nc").read_text(encoding="ascii").splitlines()
    passes = [line for line in program if line not in AROUND] * (PASSES + 1)
    run = simulate(machine, "\n".join(passes), seed=seed, name="air.nc").run
    first = len(run) // (PASSES + 1)
    raw: dict[tuple[int, int], list[int]] = {}
    for axis, label in enumerate(LABELS):
        letter = label.lower()
        diff = run[f"{letter}_ref_mm"] - run[f"{letter}_pos_mm"]
        for channel, shown in enumerate(CHANNELS):
            values = diff if shown.column == "diff_mm" else run[f"{letter}_{shown.column}"]
            raw[axis, channel] = [int(one) for one in np.round(values[first:] / shown.factor)]
    return ServoTrace(raw)
