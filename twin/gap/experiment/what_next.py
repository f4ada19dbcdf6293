"""The next experiment of a diagnosis: between effects that can't be told apart, or for a remainder without a name."""

from collections.abc import Sequence

from twin.errors import TwinError
from twin.gap.diagnosis import Cell, Effected, NextExperiment, Verdict
from twin.gap.experiment.choice import next_experiment
from twin.gap.experiment.envelope import envelope_of
from twin.gap.experiment.remainder import remainder_experiment
from twin.gap.labels import measured_signals
from twin.gap.refitted import with_effects
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.plan import Ground
from twin.gap.verdict import Judged
from twin.machine import MachineFile

RIVALS_MAX = 3


def what_next(
    ground: Ground, before: MachineFile, after: MachineFile, stages: Sequence[Judged], left: Sequence[Cell]
) -> NextExperiment | None:
    """The experiment that would say most; None where nothing is open, or the menu's programs can't run such a machine.

    left: where the gap lies that is left
    """
    try:
        return _what_next(ground, before, after, stages, left)
    except TwinError:  # an effect that needs what a short program in air does not have: a temperature, a cut
        return None


def _what_next(
    ground: Ground, before: MachineFile, after: MachineFile, stages: Sequence[Judged], left: Sequence[Cell]
) -> NextExperiment | None:
    measured = frozenset(s for run in ground.runs for s in measured_signals(run.log))
    floors = {
        signal: min(float(ground.floors.of(run.log, signal).min()) for run in ground.runs if run.log.has(signal))
        for signal in measured
    }
    for stage in stages:
        for effected, rivals in stage.explained.rivals.items():
            hypotheses = _hypotheses(before, after, stage, effected, rivals[:RIVALS_MAX])
            if len(hypotheses) > 1:
                return next_experiment(hypotheses, measured, envelope_of(run.log for run in ground.runs), floors)
    for stage in stages:
        axis = stage.explained.stage
        if stage.verdict in (Verdict.UNKNOWN, Verdict.PARTLY) and isinstance(axis, AxisStage):
            envelope = envelope_of(run.log for run in ground.runs)
            tried = frozenset(e.effect for e in stage.explained.best.effects)
            found = remainder_experiment(axis.letter, left, after, measured, envelope, floors, without=tried)
            if found is not None:
                return found
    return None


def _hypotheses(
    before: MachineFile, after: MachineFile, stage: Judged, effected: Effected, rivals: tuple[Effected, ...]
) -> list[tuple[Effected, MachineFile]]:
    tried = {t.effected: t.found for t in stage.explained.tried}
    kept = tuple(e for e in after.effects if (e.effect, e.on) != (effected.effect, effected.on))
    hypotheses = [(effected, after)]
    for rival in rivals:
        found = tried.get(rival)
        there = any((e.effect, e.on) == (rival.effect, rival.on) for e in kept)  # found itself, later on
        if found is not None and rival in found.values and not there:
            bare = after.model_copy(update={"effects": kept})
            hypotheses.append((rival, with_effects(bare, [(rival, found.values[rival])])))
    return hypotheses
