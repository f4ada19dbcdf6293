"""The next experiment for what is left without a name: by where it lies, the effects that it could be, and the program that tells
which.

Each effect is put on the machine at the size that makes as much of it as is left, by one run of a program of the menu and, since
most effects are in proportion to their parameter, one step from there; the programs are then judged as between any hypotheses
(`twin.gap.experiment.choice`).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from twin.effects.catalogue import catalogue, effect_named
from twin.errors import TwinError
from twin.gap.diagnosis import Cell, Effected, NextExperiment
from twin.gap.experiment.choice import Hypothesis, next_experiment, sensor_floor
from twin.gap.experiment.envelope import Envelope
from twin.gap.experiment.menu import Snippet, axis_menu
from twin.gap.experiment.run import Columns, Trial, shown, trial_of
from twin.gap.stages.free import Form, effect_parameters
from twin.gap.wording import regime_words
from twin.machine import AddedEffect, MachineFile
from twin.runlog import AXIS_COLUMN

SIZES = (0.02, 20.0)


def remainder_experiment(
    axis: str,
    where_after: Sequence[Cell],
    machine: MachineFile,
    measured: frozenset[str],
    envelope: Envelope,
    floors: Mapping[str, float],
    *,
    without: frozenset[str] = frozenset(),
) -> NextExperiment | None:
    """The program that tells what the remainder on an axis is.

    where_after: the cells of the gap that is left; machine: the twin with the causes that were found; without: effects that it
    cannot be, because they were tried on every run and closed nothing

    None where nothing was discovered on that axis, or no program can be run.
    """
    cells = [c for c in where_after if c.discovered and (m := AXIS_COLUMN.match(c.signal)) and m[1] == axis]
    if not cells or axis not in machine.axes:
        return None
    of: dict[str, float] = {}
    for cell in cells:
        of[cell.regime] = of.get(cell.regime, 0.0) + cell.share
    regime = max(of, key=lambda name: of[name])
    largest = max((c for c in cells if c.regime == regime), key=lambda cell: cell.rms)
    there = {(added.effect, added.on) for added in machine.effects}
    only_table = all(cell.signal.endswith("_table_mm") for cell in cells)
    could = likely_effects("table" if only_table else regime)
    names = [n for n in could if n not in without and (n, axis) not in there]
    snippet = next((s for s in axis_menu(axis, envelope, None) if s.does.startswith("full strokes")), None)
    if snippet is None:
        return None
    hypotheses = _sized(names, axis, machine, snippet, envelope, largest, floors)
    found = next_experiment(hypotheses, measured, envelope, floors)
    if found is None:
        return None
    why = (
        f"what is left on {axis} lies mostly {regime_words(regime)} and has no name; if it is of the catalogue, this {found.why}"
    )
    return NextExperiment(why, found.program, found.seconds, found.separation)


def likely_effects(regime: str) -> tuple[str, ...]:
    """Return the effects that a gap in a regime of an axis most often is, the likeliest first.

    >>> likely_effects("table"), likely_effects("constant speed -") == likely_effects("constant speed +")
    (('backlash', 'screw_compliance', 'lead_error'), True)
    """
    either_sign = regime.rstrip(" -+")
    place = {effect.name: effect.likely_in[either_sign] for effect in catalogue().values() if either_sign in effect.likely_in}
    return tuple(sorted(place, key=lambda name: place[name]))


def _sized(
    names: Sequence[str],
    axis: str,
    machine: MachineFile,
    snippet: Snippet,
    envelope: Envelope,
    cell: Cell,
    floors: Mapping[str, float],
) -> list[Hypothesis]:
    """The machine with each effect at the size that makes a gap of the cell's rms, but those that do not show in its signal."""
    trial = trial_of(snippet, machine, envelope)
    base = shown(machine, trial)
    floor = floors.get(cell.signal) or sensor_floor(machine, cell.signal)
    hypotheses = []
    for name in names:
        size = 1.0
        for _ in range(2):
            candidate = _with_effect(machine, name, axis, size)
            made = None if candidate is None else _rms(base, candidate, trial, cell.signal, floor)
            if not made:
                break
            size = float(np.clip(size * cell.rms / made, *SIZES))
        final = _with_effect(machine, name, axis, size) if made else None
        if final is not None:
            hypotheses.append((Effected(name, axis), final))
    return hypotheses


def _rms(base: Columns, candidate: MachineFile, trial: Trial, signal: str, floor: float) -> float | None:
    """Root mean square of what the effect changes in a signal, in floors; None where it cannot be run or changes nothing."""
    try:
        columns = shown(candidate, trial)
    except TwinError:
        return None
    if signal not in columns:
        return None
    rms = float(np.sqrt(np.nanmean((columns[signal] - base[signal]) ** 2))) / floor
    return rms if np.isfinite(rms) and rms > 0.0 else None


def _with_effect(machine: MachineFile, name: str, axis: str, size: float) -> MachineFile | None:
    """The machine with an effect at a multiple of its typical size; None where the axis lacks what it needs."""
    effect = effect_named(name)
    given = machine.axes[axis]
    if any(getattr(given, need, 1.0) is None for need in effect.needs):
        return None
    values = {}
    for free, parameter in zip(effect_parameters(effect), effect.parameters, strict=True):
        theta = 0.0 if free.form is Form.FACTOR else parameter.typical if free.is_angle else size
        values[parameter.name] = float(free.value(np.array(float(np.clip(theta, free.low, free.high)))))
    values |= {parameter: getattr(given, constant) * 0.5 for constant, parameter in effect.lowers.items()}
    added = AddedEffect(effect=name, on=axis, parameters=values)
    return machine.model_copy(update={"effects": (*machine.effects, added)})
