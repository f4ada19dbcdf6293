"""Optimises a program: reads it, searches, rounds, rewrites, reads the result again, and says what it is worth.

    question → problem (program, cuts, limits) → closed form → islands evolve, epoch by epoch → words → rewritten, read again
    → answer

Everything is a value, so that a search that was stopped goes on from its last checkpoint and ends where it would have ended.
"""

import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import OptimisationError
from twin.optimisation.answer import FrontPoint, Objective, Optimised, Search
from twin.optimisation.answered import answered
from twin.optimisation.forces import CutForces
from twin.optimisation.front import knee, not_dominated
from twin.optimisation.islands import TIE, evolve_piece, fitness_of, polished
from twin.optimisation.margin import advance_of_words, margin
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem, single
from twin.optimisation.resimulation import resimulated
from twin.optimisation.rewriting import lines_executed, rewritten
from twin.optimisation.rounding import rounded
from twin.optimisation.seeds import closed_form, coarser, in_sequence, worth_of

Floats = NDArray[np.float64]
Spread = Callable[[Callable[[str], str], Sequence[str]], Iterable[str]]
Progress = Callable[[float, str], None]
EPOCH = 10
FREEZES_MAX = 8
FRONT_MAX = 60
SEARCHED, PRICE_FROM = 0.67, 0.7
"""Parts of the work that are done when the search has ended, and when that for the price of a probability begins."""


class Stopped(Exception):  # noqa: N818 - no error: the caller asked for it
    """The search was asked to stop; its checkpoint says where."""


@dataclass(frozen=True, slots=True)
class Hooks:
    """The hooks of a search.

    spread: as `map`, in order; progress: part done, and what is being done; clock: seconds
    save: is given a checkpoint, a text, after every epoch; stop: whether it was asked to stop
    """

    spread: Spread = map
    progress: Progress = lambda _part, _what: None
    save: Callable[[str], None] = lambda _text: None
    stop: Callable[[], bool] = lambda: False
    clock: Callable[[], float] = lambda: 0.0


NO_HOOKS = Hooks()


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """genes: (candidates, p) of the last populations, with values (candidates, 2) of seconds and cost; history as of `Search`"""

    genes: Floats
    values: Floats
    history: tuple[float, ...]
    evaluations: int


def optimise(question: Question, hooks: Hooks = NO_HOOKS, checkpoint: str | None = None, *, resimulate: bool = True) -> Optimised:
    """The answer to a question.

    checkpoint: what `hooks.save` was given last; one of another question is passed over
    resimulate: run both programs on the whole simulated machine too, where it has axes

    Raises TwinError where program or machine are at fault, LimitsError where the limits leave a line nothing, Stopped.
    """
    began = hooks.clock()
    hooks.progress(0.0, "reading the program")
    _check_lines(question)
    question = _followed(question.with_(margin=margin(question)))
    for freezes in itertools.count():
        made = problem(question)
        searched = search(question, hooks, checkpoint)
        genes, evaluations, chosen = _chosen(made, question, searched)
        _go_on(hooks, SEARCHED, "rewriting the program")
        feed, rpm = _words(made, question, genes)
        text = rewritten(made, *rounded(made, feed, rpm, worth_of(made, single(question.objective))))
        if not text.not_followed:
            break
        question = _with_left_alone(question, made, text.not_followed, freezes)
    again = None
    if resimulate:
        _go_on(hooks, SEARCHED + 0.01, "simulating the rewritten program")
        again = resimulated(made.program.machine, made.program.text, text.text, question.planned is not None)
    front = _front(made, searched, chosen) if question.objective is Objective.PARETO else ()
    how = Search(
        method=f"genetic algorithm, {question.islands} islands, seeded with the closed form of each line"
        if question.objective is not Objective.PARETO
        else "NSGA-II (pymoo), seeded with the closed form of each line for a sweep of what a second is worth",
        seed=question.seed,
        population=question.population,
        evolutions=question.evolutions,
        evaluations=searched.evaluations + evaluations,
        history=searched.history,
        seconds=hooks.clock() - began,
    )
    _go_on(hooks, PRICE_FROM, "what it is worth")
    return answered(question, made, text, how, front, again, partial(_least, hooks))


def _least(hooks: Hooks, question: Question) -> float:
    """The least time or cost that one island finds, its words rounded as a program has them; nothing of it is kept.

    Raises OptimisationError where no program keeps the limits, Stopped.
    """
    question = question.with_(objective=single(question.objective), pick=None, islands=1)
    question = _followed(question.with_(margin=margin(question)))

    def progress(part: float, _what: str) -> None:
        hooks.progress(PRICE_FROM + (1.0 - PRICE_FROM) * part, "what its probability costs")

    searched = search(question, replace(hooks, save=lambda _text: None, progress=progress), None)
    made = problem(question)
    genes, _, _ = _chosen(made, question, searched)
    feed, rpm = rounded(made, *_words(made, question, genes), worth_of(made, question.objective))
    seconds, cost = made.evaluate_words(feed[None], rpm[None])
    return float((seconds if question.objective is Objective.TIME else cost)[0])


def _go_on(hooks: Hooks, part: float, what: str) -> None:
    """Says what comes next. Raises Stopped where it was asked to stop; the checkpoint of the search is there."""
    if hooks.stop():
        raise Stopped
    hooks.progress(part, what)


def _words(made: Problem, question: Question, genes: Floats) -> tuple[Floats, Floats]:
    """Feeds and speeds of the candidate; or of the closed form or the best sequence, which genes can miss by a hair."""
    (feed,), (rpm,) = made.decoded(genes[None])
    if question.objective is Objective.PARETO:
        return feed, rpm
    known = [(feed, rpm), *in_sequence(made, question.objective)]
    for other in coarser(made):
        known += in_sequence(other, question.objective)
    seconds, cost = made.evaluate_words(np.array([one for one, _ in known]), np.array([one for _, one in known]))
    value = seconds if question.objective is Objective.TIME else cost
    best = int(np.argmin(value))
    return known[best] if value[best] < value[0] * (1.0 - TIE) else known[0]


def _check_lines(question: Question) -> None:
    """Raises OptimisationError where a line that is to be left alone is no line that feeds."""
    feeding = {line.line for line in problem(question).program.lines}
    for line in question.left_alone:
        if line not in feeding:
            raise OptimisationError(f"line {line + 1} cannot be left alone: it is not a line that feeds")


def _followed(question: Question) -> Question:
    """The question with the lines left alone whose words the control would not follow: found out before the search."""
    for freezes in itertools.count():
        made = problem(question)
        if not made.genes:
            break
        alone = single(question.objective)
        feed, rpm = rounded(made, *closed_form(made, alone), worth_of(made, alone))
        missed = rewritten(made, feed, rpm).not_followed
        if not missed:
            break
        question = _with_left_alone(question, made, missed, freezes)
    return question


def _with_left_alone(question: Question, made: Problem, missed: Mapping[int, str], freezes: int) -> Question:
    """The question with these lines left alone; where they are already, with the line before them, which they take a word from.

    freezes: how often this was done; from `FREEZES_MAX` on, all lines before them. Raises OptimisationError where none is left.
    """
    free = {line.line for line in made.program.lines if not line.left_alone}
    new = {line: why for line, why in missed.items() if line in free}
    order = lines_executed(made)
    for line in () if new else missed:
        places = [place for place, number in enumerate(order) if number == line]
        for place in places:
            before = list(dict.fromkeys(number for number in reversed(order[:place]) if number in free))
            why = f"line {line + 1} after it is left alone, and runs at what this one leaves in force"
            new |= dict.fromkeys(before if freezes >= FREEZES_MAX else before[:1], why)
    if not new:
        line, why = next(iter(missed.items()))
        raise OptimisationError(f"line {line + 1}: {why}, and no line before it is left that could be left alone for it")
    return question.with_(left_alone={**question.left_alone, **new})


def search(question: Question, hooks: Hooks, checkpoint: str | None) -> Searched:
    """The islands, epoch by epoch. The checkpoint of the same question is gone on with, and gives the same answer."""
    made, digest = problem(question), question.with_(pick=None).digest()
    if not made.genes:
        raise OptimisationError(_nothing_free(made))
    states: list[Any] = [None] * question.islands
    done = 0
    if checkpoint is not None and (kept := json.loads(checkpoint)).get("question") == digest:
        states, done = kept["states"], int(kept["done"])
    text = question.to_json()
    while done < question.evolutions or states[0] is None:
        if hooks.stop():
            raise Stopped
        more = min(EPOCH, question.evolutions - done)
        pieces = [
            json.dumps({"question": text, "island": k, "state": state, "evolutions": more}) for k, state in enumerate(states)
        ]
        states = [json.loads(answer) for answer in hooks.spread(evolve_piece, pieces)]
        done += more
        hooks.save(json.dumps({"question": digest, "states": states, "done": done}))
        hooks.progress(
            0.05 + (SEARCHED - 0.05) * done / max(question.evolutions, 1), f"evolution {done} of {question.evolutions}"
        )
    genes = np.concatenate([np.array(state["genes"], dtype=np.float64) for state in states])
    histories = [state["history"] for state in states]
    best = max if question.objective is Objective.PARETO else min
    history = tuple(float(best(values)) for values in zip(*histories, strict=True))
    evaluations = sum(int(state["evaluations"]) for state in states)
    if question.objective is Objective.PARETO:
        genes, more = _with_polished_ends(made, genes)
        evaluations += more
    return Searched(genes, np.column_stack(made.evaluate(genes)), history, evaluations)


def _with_polished_ends(made: Problem, genes: Floats) -> tuple[Floats, int]:
    """The candidates, and the fastest and the cheapest of them polished as a search for one of both does it."""
    evaluations = 0
    for objective in (Objective.TIME, Objective.COST):
        fitness = fitness_of(made, objective)
        better, more = polished(made, genes[int(np.argmin(fitness(genes)))], fitness)
        genes, evaluations = np.concatenate([genes, better[None]]), evaluations + more + len(genes)
    return genes, evaluations


def _nothing_free(made: Problem) -> str:
    """Why no line may be changed: the reason that most of them have."""
    reasons = Counter(line.left_alone for line in made.program.lines)
    if not reasons:
        return "the program has no feed move"
    why, count = reasons.most_common(1)[0]
    return f"none of the {len(made.program.lines)} feed lines may be changed; {count} of them: {why}"


def _chosen(made: Problem, question: Question, searched: Searched) -> tuple[Floats, int, int]:
    """Genes of the candidate that is written, evaluations that choosing it took, and its number in the search."""
    if question.objective is Objective.PARETO:
        points = _front_points(searched)
        pick = knee(searched.values[points]) if question.pick is None else question.pick
        if not 0 <= pick < len(points):
            raise OptimisationError(f"--pick {pick}: the front has {len(points)} programs, from 0 to {len(points) - 1}")
        return searched.genes[points[pick]], 0, int(points[pick])
    fitness = fitness_of(made, question.objective)
    at = int(np.argmin(fitness(searched.genes)))
    genes, evaluations = polished(made, searched.genes[at], fitness)
    return genes, evaluations, at


def _front_points(searched: Searched) -> NDArray[np.int64]:
    """Numbers of the candidates that are the front, the fastest first; of very many some, evenly."""
    points = not_dominated(searched.values)
    if len(points) > FRONT_MAX:
        points = points[np.linspace(0, len(points) - 1, FRONT_MAX).round().astype(np.int64)]
    return points


def _front(made: Problem, searched: Searched, chosen: int) -> tuple[FrontPoint, ...]:
    points = _front_points(searched)
    forces = CutForces.of(made.program)
    front = []
    for k in points.tolist():
        (feed,), (rpm,) = made.decoded(searched.genes[k : k + 1])
        own = rpm[made.cutting]
        peak = float(forces.peak_n(advance_of_words(made, forces, feed, rpm)).max()) if len(forces.cuts) else 0.0
        span = (float(own.min()), float(own.max())) if len(own) else (0.0, 0.0)
        seconds, cost = searched.values[k].tolist()
        front.append(FrontPoint(seconds, cost, peak, span, k == chosen))
    return tuple(front)
