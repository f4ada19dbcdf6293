"""Joins the diagnosis of what a machine does with that of how long its programs take: two gaps of one machine."""

from dataclasses import replace

from twin.gap.diagnosis import Diagnosed, Verdict


def joined(motion: Diagnosed, programs: Diagnosed) -> Diagnosed:
    """Both in one answer. The gap's figures are those of the motion; the sections of the programs stand by signal beside them."""
    one, other = motion.diagnosis, programs.diagnosis
    seen = {c.effect for c in (*one.candidates, *other.candidates)}
    blind = {n.effect for n in one.not_observable} & {n.effect for n in other.not_observable}
    diagnosis = replace(
        one,
        verdict=_verdict({one.verdict, other.verdict}),
        sentence=f"{one.sentence} How long programs take: {other.sentence}",
        where=one.where + other.where,
        where_after=one.where_after + other.where_after,
        patterns=one.patterns + other.patterns,
        causes=one.causes + other.causes,
        gap=replace(one.gap, by_signal={**one.gap.by_signal, **other.gap.by_signal}),
        candidates=tuple(sorted(one.candidates + other.candidates, key=lambda c: (c.p_value, -c.closure))),
        not_observable=tuple(
            n for n in (*one.not_observable, *other.not_observable) if n.effect not in seen and n.effect in blind
        ),
        not_identifiable=one.not_identifiable + other.not_identifiable,
        next_experiment=one.next_experiment or other.next_experiment,
        notes=one.notes + other.notes,
        subsystems=tuple(sorted(one.subsystems + other.subsystems, key=lambda s: -s.before)),
        constants=one.constants + other.constants,
        learned=one.learned + other.learned,
    )
    added = tuple(e for e in programs.twin.effects if e not in motion.twin.effects)
    twin = motion.twin.model_copy(
        update={
            "program": programs.twin.program,
            "effects": motion.twin.effects + added,
            "learned": motion.twin.learned + tuple(t for t in programs.twin.learned if t not in motion.twin.learned),
            "uncertainty": {**programs.twin.uncertainty, **motion.twin.uncertainty},
        }
    )
    return Diagnosed(diagnosis, twin, motion.traces + programs.traces)


def _verdict(both: set[Verdict]) -> Verdict:
    if len(both) == 1:
        return next(iter(both))
    if both == {Verdict.HEALTHY, Verdict.EXPLAINED}:
        return Verdict.EXPLAINED
    return Verdict.UNKNOWN if both == {Verdict.HEALTHY, Verdict.UNKNOWN} else Verdict.PARTLY
