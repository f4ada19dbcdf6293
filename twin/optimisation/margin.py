"""By how much to stay below the force limit, so that it is kept with a probability: found on the closed form of each line."""

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem, single
from twin.optimisation.seeds import closed_form
from twin.optimisation.uncertainty import margin_for

Floats = NDArray[np.float64]
MARGINS_MAX = 5


def margin(question: Question) -> float:
    """By what the force limit is divided, so that it is kept with the probability that was asked for; 1 without one."""
    found = 1.0
    if question.probability is None:
        return found
    for _ in range(MARGINS_MAX):
        made = problem(question.with_(margin=found))
        forces = CutForces.of(made.program)
        feed, rpm = closed_form(made, single(question.objective))
        advance = advance_of_words(made, forces, feed, rpm)
        before, found = found, margin_for(forces, advance, made.program.machine, question.probability, question.seed)
        if abs(found - before) <= 1e-3 * found:
            break
    return found


def advance_of_words(made: Problem, forces: CutForces, feed: Floats, rpm: Floats) -> Floats:
    """Advance of each cut; of lines that are left alone as programmed."""
    lines = made.program.lines
    all_feed = np.array([line.feed_mm_min for line in lines])
    all_rpm = np.array([max(line.rpm, 1e-9) for line in lines])
    all_feed[made.allowed.index] = feed
    all_rpm[made.allowed.index] = np.maximum(rpm, 1e-9)
    owner = made.program.cuts.line
    return np.asarray(all_feed[owner] * made.control.feed_ratio / (forces.teeth * all_rpm[owner]))
