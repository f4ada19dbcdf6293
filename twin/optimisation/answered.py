"""The answer put together: lines, totals, distance to the bound, what the uncertainty makes of it, in words and figures."""

import difflib
import math
from collections.abc import Sequence
from dataclasses import replace

from twin.machine import Limits
from twin.motion.path import Path
from twin.optimisation.allowed import limits_of
from twin.optimisation.answer import Bound, FrontPoint, LineAnswer, Objective, Optimised, Resimulated, Search, Sensitivity, Totals
from twin.optimisation.bound import bound_of
from twin.optimisation.forces import CutForces
from twin.optimisation.learned_forces import learned_notes
from twin.optimisation.price import Least, price_pct
from twin.optimisation.problem import Problem
from twin.optimisation.program import FeedLine
from twin.optimisation.question import Question, single
from twin.optimisation.reasons import what_binds
from twin.optimisation.rewriting import Rewritten
from twin.optimisation.seeds import by_itself
from twin.optimisation.shown import ShownLines, advance_of_cuts, limits_shown, shown_lines, totals
from twin.optimisation.speeds.notes import speed_notes
from twin.optimisation.speeds.stretches import changes_in_material
from twin.optimisation.uncertainty import sensitivity
from twin.programs.source import source_lines

LINES_SHOWN = 5


def answered(
    question: Question, made: Problem, text: Rewritten, how: Search, front: tuple[FrontPoint, ...], again: Resimulated | None,
    least: Least,
) -> Optimised:  # fmt: skip
    """The answer: both programs as they are cut, and what is known of the difference.

    text: the rewritten program; how: the search; front: empty where one objective was asked for; again: of the whole machine
    least: a search for another question, by which the probability of the force limit gets its price
    """
    machine, forces, alone = made.program.machine, CutForces.of(made.program), single(question.objective)
    limits = limits_of(machine, question.force_limit_n)
    before, after = (shown_lines(made, forces, path) for path in (made.program.path, text.path))
    figures = [_totals(made, shown, path, limits) for shown, path in ((before, made.program.path), (after, text.path))]
    value = figures[1].seconds if alone is Objective.TIME else figures[1].cost
    assert value is not None
    bound = bound_of(made, alone, value) if not front else _bound_of_front(made, front)
    known = None
    if limits.force_n is not None:
        advance = advance_of_cuts(made, text.path)
        known = sensitivity(forces, advance, machine, limits.force_n, question.probability, question.seed)
        if known is not None:
            known = replace(
                known, price_pct=price_pct(question, min((point.cost for point in front), default=value), known, least)
            )
    old, new = source_lines(made.program.text), source_lines(text.text)
    return Optimised(
        name=question.name,
        machine=machine.machine.name,
        objective=question.objective,
        currency=made.economy.currency if made.economy is not None else "",
        sentence=_sentence(question, made, figures, bound, limits, known),
        limits=limits_shown(made, limits),
        before=figures[0],
        after=figures[1],
        bound=bound,
        lines=_lines(made, before, after, text, question.objective),
        front=front,
        sensitivity=known,
        search=how,
        resimulated=again,
        notes=_notes(made, question, text.path, value),
        diff="\n".join(difflib.unified_diff(old, new, question.name, f"{question.name}, optimised", lineterm="", n=1)),
        program=text.text,
        collisions=made.program.collisions,
        speed_changes=made.groups.changes,
        changes_in_material=len(changes_in_material(made.program, text.path)),
    )


def _bound_of_front(made: Problem, front: tuple[FrontPoint, ...]) -> Bound:
    """Return the bound of the front's two ends: the least cost, and in words the least time."""
    cheapest = bound_of(made, Objective.COST, min(point.cost for point in front))
    fastest = bound_of(made, Objective.TIME, min(point.seconds for point in front))
    how = f"of the cheapest program; the fastest is {_part(fastest.distance)} above the least time of {fastest.value:.2f} s"
    return Bound(cheapest.value, cheapest.distance, cheapest.exact and fastest.exact, f"{how}; {cheapest.how}")


def _lines_of(count: int) -> str:
    return f"{count} line{'' if count == 1 else 's'}"


def _part(part: float) -> str:
    return f"{100 * part:.2g} %" if part < 1.0 else f"{100 * part:.0f} %"


def _totals(made: Problem, shown: ShownLines, path: Path, limits: Limits) -> Totals:
    seconds, cost = made.evaluate_path(path)
    return totals(shown, seconds, cost if made.economy is not None else None, limits, made)


def _lines(made: Problem, before: ShownLines, after: ShownLines, text: Rewritten, objective: Objective) -> tuple[LineAnswer, ...]:
    old, new = source_lines(made.program.text), source_lines(text.text)
    rows = {int(k): row for row, k in enumerate(made.allowed.index)}
    feed, rpm = by_itself(made, single(objective))
    answers = []
    for k, line in enumerate(made.program.lines):
        row = rows.get(k)
        deepest = float(made.program.cuts.axial_depth_mm[slice(*line.cuts)].max(initial=0.0))
        answers.append(
            LineAnswer(
                line=line.line,
                text_before=old[line.line],
                text_after=new[line.line],
                length_mm=line.length_mm / len(line.executions),
                cut_mm=line.cut_mm / len(line.executions),
                times=len(line.executions),
                axial_depth_mm=deepest,
                before=before.line(k),
                after=after.line(k),
                binds=""
                if row is None
                else what_binds(made, row, after.line(k), float(after.waits_s[k]), objective, float(rpm[row])),
                bound=None if row is None else (float(feed[row]), float(rpm[row])),
                left_alone=line.left_alone,
                force_known=not line.plunges,
            )
        )
    return tuple(answers)


def _sentence(
    question: Question, made: Problem, figures: list[Totals], bound: Bound, limits: Limits, known: Sensitivity | None
) -> str:
    before, after = figures

    def change(old: float, new: float) -> str:
        return f"{100 * (new / old - 1):+.1f} %".replace("-", "−")

    parts = []
    if made.program.collisions:
        parts.append(f"a RAPID GOES INTO MATERIAL in line {made.program.collisions[0]}")
    if after.over:
        parts.append(f"{_lines_of(after.over)} left alone ABOVE A LIMIT")
    parts.append(f"{before.seconds:.2f} s to {after.seconds:.2f} s ({change(before.seconds, after.seconds)})")
    if before.cost is not None and after.cost is not None and made.economy is not None:
        parts.append(f"{before.cost:.4g} to {after.cost:.4g} {made.economy.currency} ({change(before.cost, after.cost)})")
    force = f"greatest force {after.force_n:.1f} N"
    parts.append(force + (f" of {limits.force_n:g} N" if limits.force_n is not None else "") + _how_surely(known))
    if before.over:
        parts.append(f"{_lines_of(before.over)} above a limit before, now {after.over or 'none'}")
    what = "the exact optimum" if bound.exact else "a bound that no program can beat"
    which = (
        f"the front's cheapest {_part(bound.distance)}"
        if question.objective is Objective.PARETO
        else f"{question.objective} {_part(bound.distance)}"
    )
    parts.append(f"{which} above {what}")
    return "; ".join(parts)


def _how_surely(known: Sensitivity | None) -> str:
    """Return how surely the force limit is kept, where that is not as surely as it should be."""
    if known is None or not known.is_unsure:
        return ""
    return f", kept with {100 * known.kept:.0f} % probability{'' if known.identified else ' (nothing identified)'}"


def _notes(made: Problem, question: Question, path: Path, value: float) -> tuple[str, ...]:
    notes = [*made.program.notes, *speed_notes(made, question, path, value)]
    if made.program.machine.program is None:
        notes.append("no [program]: time is length over feed; corners, ramps and changes of speed take none")
    alone = [line for line in made.program.lines if line.left_alone]
    if plunging := sum(line.plunges for line in made.program.lines):
        notes.append(f"the force of {plunging} lines that go down into material is not modelled: it is in no figure and no limit")
    if alone:
        head = f"{len(alone)} of {len(made.program.lines)} feed lines are left alone (line numbers are those of the text)"
        notes.append(f"{head}: {_reasons(alone, made)}")
    if made.economy is not None and not made.economy.wears_in_cut:
        notes.append('the tool is taken to wear all the time (Eq. 20); [cost] tool_wears = "in_cut" counts cutting only')
    if limits_of(made.program.machine, question.force_limit_n).chip_mm is None:
        notes.append("no limit of the chip: look at the greatest one, or write chip_mm in [limits]")
    if limits_of(made.program.machine, question.force_limit_n).surface_speed_m_min is None:
        fastest = _fastest_m_min(made, path)
        notes.append(
            f"no limit of the surface speed: the greatest is {fastest:.0f} m/min; surface_speed_m_min in [limits] holds it"
        )
    if any(tool.modes for _, tool in made.program.tools):
        notes.append("chatter by zero order: where teeth cut one by one a pocket can hold less than it promises; try it before")
    notes += learned_notes(made.program.machine)
    if question.planned is not None:
        notes.append("what the lines cut is taken from a run log")
    if limits_of(made.program.machine, question.force_limit_n).force_n is None:
        notes.append("no force limit: --force-limit-n, or force_n in [limits]")
    return tuple(notes)


def _reasons(alone: Sequence[FeedLine], made: Problem) -> str:
    """Return the lines left alone by their reason, a few of each, with the block numbers that the program gives them."""
    source, block_of = source_lines(made.program.text), made.program.words.block_number
    by_why: dict[str, list[int]] = {}
    for line in alone:
        by_why.setdefault(line.left_alone, []).append(line.line + 1)
    said = []
    for why, numbers in by_why.items():
        more = f" and {len(numbers) - LINES_SHOWN} more" if len(numbers) > LINES_SHOWN else ""
        first = [(number, block_of(source[number - 1])) for number in sorted(numbers)[:LINES_SHOWN]]
        shown = ", ".join(f"{number}" if block is None else f"{number} (block {block})" for number, block in first)
        said.append(f"line{'s'[: len(numbers) > 1]} {shown}{more}: {why}")
    return "; ".join(said)


def _fastest_m_min(made: Problem, path: Path) -> float:
    """Return the greatest surface speed of the lines that cut, m/min."""
    rpm, lines, allowed = path.commanded_rpm(), made.program.lines, made.allowed
    speeds = [
        math.pi * float(allowed.diameter_mm[row]) * abs(float(rpm[lines[int(k)].executions[0][0]])) / 1000.0
        for row, k in enumerate(allowed.index)
        if allowed.cutting[row]
    ]
    return max(speeds, default=0.0)
