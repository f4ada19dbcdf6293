"""The diagnosis of recorded programs: in which sections they take longer than the twin says, which effects of the control make up
for it, and how far the gap shrinks on programs that were not fitted.

The twin before is the machine as described; without [program] it knows length over feed only, and the rapid rate is read off the
recordings. Overrides that a recording tells are inputs. Runs that were not finished, or are not of the program given, are left
out and said to be so; pauses are taken out.
"""

from collections.abc import Callable, Sequence

import numpy as np

from twin.case import Case, RunKind
from twin.effects.catalogue import catalogue
from twin.effects.effect import Excitation
from twin.errors import CaseError, RunLogError
from twin.gap.diagnosis import Diagnosed, NotObservable
from twin.gap.programs.answer import Answer, Trials
from twin.gap.programs.knobs import rapid_rate_of, with_rapids_read
from twin.gap.programs.search import search
from twin.gap.programs.trial import Refused, Trial, trial_of
from twin.machine import MachineFile
from twin.motion.control import RAPID_MM_MIN, program_effects
from twin.motion.limits import Limits
from twin.motion.path import EventKind, Kind
from twin.sites import Site

SHORTEST_BLOCK_S = 1.0
"""A block time cannot show where no cutting block is shorter."""


def diagnose_programs(
    case: Case,
    *,
    without: frozenset[str] = frozenset(),
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 4,
) -> Diagnosed:
    """The diagnosis of the runs of kind `program` of a case; `seconds` is left at 0 for who has a clock.

    without: effects left out of the catalogue; seed: of the resampling

    Raises CaseError where no run can be compared with its program, naming what is amiss with each.
    """
    progress("time: reading programs and runs")
    trials = _trials(case)
    absent = _not_observable(trials)
    gone = set(trials.already) | {one.effect for one in absent} | without
    candidates = [name for name, effect in catalogue().items() if effect.site is Site.PROGRAM and name not in gone]
    rng = np.random.default_rng(seed)
    found = search(trials.learnt, trials.judged, trials.stated, trials.already, candidates, rng, progress)
    progress("time: where the gap lies")
    return Answer(trials, found, absent, rng).diagnosed()


def _trials(case: Case) -> Trials:
    """The runs that can be compared, and the limits to start from."""
    read = [trial_of(run, case.machine.settings) for run in case.of(RunKind.PROGRAM)]
    trials = tuple(one for one in read if isinstance(one, Trial))
    refused = tuple(f"{one.name} {one.why}" for one in read if isinstance(one, Refused))
    if not trials:
        raise CaseError(f"{case.name}: no run can be compared with its program: {'; '.join(refused) or 'there is none'}")
    notes = [*refused, *(f"{trial.name} {remark}" for trial in trials for remark in trial.remarks)]
    learnt, judged = (tuple(t for t in trials if t.fitted is fitted) for fitted in (True, False))
    if not judged or not learnt:
        notes.append(
            f"no run to {'judge on' if learnt else 'learn from'} could be compared: the gap is judged on what was fitted"
        )
        learnt = judged = trials
    told = sum(trial.overrides_told for trial in trials)
    if told < len(trials):
        notes.append(
            f"overrides are not recorded in {len(trials) - told} of {len(trials)} runs: knobs are taken to stand at 100 %"
        )
    stated, said = _stated(case.machine, trials)
    with_knobs, knobs = with_rapids_read(trials, float(np.max(stated.rapid_mm_min)))
    by_name = {trial.name: trial for trial in with_knobs}
    learnt, judged = (tuple(by_name[trial.name] for trial in some) for some in (learnt, judged))
    return Trials(case.machine, stated, program_effects(case.machine), learnt, judged, (*notes, *said, *knobs))


def _stated(machine: MachineFile, trials: Sequence[Trial]) -> tuple[Limits, tuple[str, ...]]:
    """[program], or length over feed with the rapid rate that the runs show."""
    if machine.program is not None:
        return Limits.of(machine.program), ()
    try:
        rate = rapid_rate_of(trials)
        said = f"the machine states no [program]: length over feed, with the rapid rate read off the runs, {rate:.0f} mm/min"
    except RunLogError:
        rate = RAPID_MM_MIN
        said = f"the machine states no [program] and no run has a long rapid: length over feed, rapids at {rate:.0f} mm/min"
    return Limits(rapid_mm_min=rate, acceleration_mm_s2=np.inf), (said,)


def _not_observable(trials: Trials) -> tuple[NotObservable, ...]:
    """Effects that none of these programs can show."""
    paths = [trial.recorded.path for trial in (*trials.learnt, *trials.judged)]
    missing: dict[Excitation, str] = {}
    if not any(event.kind in (EventKind.TOOL_CHANGE, EventKind.SPINDLE) for path in paths for event in path.events):
        missing[Excitation.TOOL_CHANGES] = "no program changes a tool or starts a spindle"
    cutting = [60.0 * p.length_mm[p.kind != Kind.RAPID] / p.feed_mm_min[p.kind != Kind.RAPID] for p in paths]
    if not len(np.concatenate(cutting)) or np.concatenate(cutting).min() > SHORTEST_BLOCK_S:
        missing[Excitation.SHORT_BLOCKS] = f"no cutting block is shorter than {SHORTEST_BLOCK_S:g} s"
    effects = catalogue().values()
    return tuple(NotObservable(e.name, why) for lacks, why in missing.items() for e in effects if e.excited_by is lacks)
