"""Opens the loops of each axis, and combines what they say with the closed loop.

The closed loop is the judge where it explains its gap, and where the controller is understood: then what the open loops find is
confirmed in it. Where the controller is another one than the twin's, the closed loop says nothing of the rest, and mechanics and
table are judged by themselves.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.gap.diagnosis import Effected, Verdict
from twin.gap.evidence import evidence_of
from twin.gap.fitting import fitted, settled, without_effect
from twin.gap.labels import AXIS
from twin.gap.naming.certain import NAMED_MIN, closed_part
from twin.gap.null import NULL, Null
from twin.gap.search import Explained, explain, with_certain, without
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.open_loop.plan import ON_TOP_OF, open_stages
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.plan import Ground, SideBySide, unheard_axes
from twin.gap.stages.stage import Model, Stage
from twin.gap.verdict import Judged, judged

FAR = 30.0
"""Gap, in floors, above which a closed loop that is partly explained is not believed either."""
STEPS_MAX = 5
TRIFLE = 0.02
"""Part of the gap of an open loop below which an effect is no cause, where the loop is not explained."""
MOST = 0.9
"""Part of the gap of an open loop that its effects have to close to stand beside those of a closed loop."""
SETTLED = {Verdict.HEALTHY, Verdict.EXPLAINED}


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """The open loops of one axis. closed: what the closed loop says, None where the reference was not recorded"""

    letter: str
    closed: Judged | None
    loops: Mapping[str, Judged]

    @property
    def decides(self) -> bool:
        """Return True where the open loops are judged in place of the closed one: its controller is not the twin's."""
        if self.closed is None:
            return True
        controller = self.loops.get("controller")
        if _names_nothing(self.closed):
            return self._hides
        if self.closed.verdict in SETTLED or controller is None:
            return False
        if self._says_more:
            return True
        unknown = self.closed.verdict is Verdict.UNKNOWN or self.closed.explained.best.left.gap() > FAR
        return unknown and controller.verdict not in SETTLED

    @property
    def _hides(self) -> bool:
        """Return True where mechanics or table alone show a gap that the control holds down, so that the closed loop does not."""
        return any(self.loops[name].verdict is not Verdict.HEALTHY for name in ON_TOP_OF if name in self.loops)

    @property
    def _says_more(self) -> bool:
        """Return True where an open loop is explained by effects that the closed one does not have."""
        known = self.closed.explained.best.effects if self.closed is not None else ()
        named = {e for loop in self.loops.values() if loop.verdict is Verdict.EXPLAINED for e in loop.explained.best.effects}
        return bool(named - set(known))

    @property
    def judged(self) -> tuple[Judged, ...]:
        """The open loops as they stand in place of the closed one: a controller that is another one has no named cause, but for
        those that the closed loop confirms."""
        known = set(self.closed.explained.best.effects) if self.closed is not None else set[Effected]()
        confirmed = {name for name, loop in self.loops.items() if known.issuperset(loop.explained.best.effects)}
        return tuple(
            _unnamed(loop) if name == "controller" and name not in confirmed else loop for name, loop in self.loops.items()
        )

    @property
    def floors(self) -> dict[tuple[str, str], float]:
        """(signal, regime) → floor of what the open loops answer beside their controller."""
        found: dict[tuple[str, str], float] = {}
        for name, loop in self.loops.items():
            stage = loop.explained.stage
            assert isinstance(stage, OpenStage)
            if name in ON_TOP_OF:
                signal = f"{self.letter}_{stage.loop.compared}"
                found |= {(signal, AXIS[regime]): floor for regime, floor in stage.floors.items()}
                found[signal, "run"] = max(stage.floors.values())
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Combined:
    """stages: what the answer is made of; opened: the axes, each with its open loops"""

    stages: list[Judged]
    opened: tuple[Opened, ...]

    @property
    def floors(self) -> dict[tuple[str, str], float]:
        """(signal, regime) → floor, of the axes that their open loops decide."""
        return {key: floor for axis in self.opened if axis.decides for key, floor in axis.floors.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on each of these axes."""
        return tuple(_note(axis) for axis in self.opened if axis.decides)


def combined(
    ground: Ground,
    found: Sequence[Judged],
    progress: Callable[[str], None],
    side_by_side: SideBySide = map,
    null: Null = NULL,
) -> Combined:
    """Return the stages of a case with the loops of each axis opened."""
    progress("opening the loops")
    closed: dict[str, Judged | None] = {s.explained.stage.letter: s for s in found if isinstance(s.explained.stage, AxisStage)}
    axes = {letter: s.explained.stage for letter, s in closed.items() if s is not None}
    for unheard in unheard_axes(ground):
        axes[unheard.letter], closed[unheard.letter] = unheard, None
    loops: list[OpenStage] = []
    for axis in axes.values():
        if isinstance(axis, AxisStage):
            loops += open_stages(axis, ground.runs, ground.repeats, ground.floors)

    def explained(stage: Stage) -> Explained:
        assert isinstance(stage, OpenStage)
        of_axis = closed[stage.letter]
        if stage.loop.name == "controller" and of_axis is not None and not of_axis.explained.tried:
            return _carried_over(stage, of_axis.explained)  # it has been looked at, and is another one
        if of_axis is None or of_axis.verdict not in SETTLED:
            return _without_trifles(explain(stage, null=null, progress=progress))
        carried = _carried_over(stage, of_axis.explained)
        if _names_nothing(of_axis) and stage.loop.name in ON_TOP_OF and judged(carried).verdict is Verdict.UNKNOWN:
            return _if_most(_without_trifles(explain(stage, null=null, progress=progress)))
        return carried

    by_axis: dict[str, dict[str, Judged]] = {}
    for loop, answer in zip(loops, side_by_side(explained, loops), strict=True):
        by_axis.setdefault(loop.letter, {})[loop.loop.name] = judged(answer)
    opened = {letter: _confirmed(Opened(letter, closed[letter], own), null) for letter, own in by_axis.items()}
    stages = [s for s in found if not isinstance(s.explained.stage, AxisStage)]
    for letter, of_axis in closed.items():
        here = opened.get(letter) or Opened(letter, of_axis, {})
        if here.decides:
            stages += here.judged
        elif here.closed is not None:
            stages.append(here.closed)
    return Combined(stages, tuple(opened.values()))


def _names_nothing(closed: Judged) -> bool:
    """Return True where a closed loop is as told, or its constants explain it."""
    return closed.verdict in SETTLED and not closed.explained.best.effects


def _unnamed(loop: Judged) -> Judged:
    if loop.verdict in SETTLED:
        return loop
    return Judged(without(loop.explained), Verdict.UNKNOWN, loop.explained.best.effects or loop.likeness)


def _note(axis: Opened) -> str:
    compared = " and ".join(name for name in axis.loops if name in ON_TOP_OF) or "nothing"
    controller = axis.loops.get("controller")
    why = "its closed loop is not explained as a whole"
    if axis.closed is None:
        why = "its reference was not recorded"
    elif _names_nothing(axis.closed):
        why = "its control holds the gap down, so that its closed loop hardly shows it"
    elif controller is None or controller.verdict not in SETTLED:
        why = "its controller is another one than the twin's"
    return f"axis {axis.letter}: {why}; {compared} compared alone, driven by what was measured"


def _carried_over(stage: OpenStage, closed: Explained) -> Explained:
    """The open loop with what the closed one has found, fitted from there."""
    count = len(stage.constants)
    bare = Model(stage.constants, ())
    base = fitted(stage, bare, closed.base.theta[:count], steps_max=STEPS_MAX)
    here = tuple(e for e in closed.best.effects if e in stage.candidates)
    if not here:
        return Explained(stage, base, base, (), {}, {})
    places = dict(closed.best.model.places())
    theta = np.concatenate([closed.best.theta[:count], *(closed.best.theta[places[e]] for e in here)])
    best = fitted(stage, replace(bare, effects=here), theta, steps_max=STEPS_MAX)
    return Explained(stage, base, best, (), {}, {})


def _if_most(explained: Explained) -> Explained:
    """The same with no effect, where they all take only a part of a gap that the closed loop does not show."""
    if closed_part(explained.base.left, explained.best.left) >= NAMED_MIN:
        return explained
    return replace(without(explained), alike=explained.best.effects or explained.alike)


def _without_trifles(explained: Explained) -> Explained:
    """The same without effects that take next to nothing of a gap of which something stays: they are shapes of what is left."""
    stage, best, reducible = explained.stage, explained.best, explained.base.left.gap() ** 2 - 1.0
    if judged(explained).verdict is Verdict.EXPLAINED:
        return explained
    for effected in best.effects:
        bare = without_effect(stage, explained.base, best, effected)
        if len(best.effects) > 1 and bare.left.gap() ** 2 - best.left.gap() ** 2 < TRIFLE * reducible:
            best = bare
    kept = set(best.effects)
    rivals = {e: r for e, r in explained.rivals.items() if e in kept}
    return replace(explained, best=best, rivals=rivals, evidence={e: a for e, a in explained.evidence.items() if e in kept})


def _confirmed(opened: Opened, null: Null) -> Opened:
    """The axis with its closed loop as its open loops complete it, where it leaves a gap and what they have found holds in it."""
    if opened.closed is None or opened.closed.verdict in SETTLED:
        return opened
    closed = opened.closed.explained
    stage, model, theta = closed.stage, closed.best.model, closed.best.theta
    rivals = dict(closed.rivals)
    for loop in opened.loops.values():
        best = loop.explained.best
        if closed.best.effects and closed_part(loop.explained.base.left, best.left) < MOST:
            continue
        for effected, place in best.model.places():
            if effected in stage.candidates and effected not in model.effects:
                model, theta = model.with_effect(effected), np.concatenate([theta, best.theta[place]])
                rivals[effected] = loop.explained.rivals.get(effected, ())
    if model.effects == closed.best.effects:
        return opened
    best = settled(stage, fitted(stage, model, theta), rounds=1)
    evidence = evidence_of(stage, closed.base, best)
    if not all(null.exceeded(effected, over, stage.healthy_rms) for effected, over in evidence.items()):
        return opened
    best, alike = with_certain(stage, closed.base, best, null)
    if len(best.effects) <= len(closed.best.effects):
        return opened
    evidence = {e: over for e, over in evidence.items() if e in best.effects}
    complete = Explained(stage, closed.base, best, closed.tried, rivals, evidence, alike=alike, notes=closed.notes)
    return replace(opened, closed=judged(complete))
