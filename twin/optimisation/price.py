"""The price of keeping the force limit with a probability: time or cost of the answer that does, over that of one that does not.

One of the two is the answer itself; the other one comes out of the same search.
"""

import math
from collections.abc import Callable

from twin.errors import OptimisationError
from twin.optimisation.answer import Sensitivity
from twin.optimisation.question import Question

Least = Callable[[Question], float]
"""The least time, s, or cost that a search finds for a question."""


def price_pct(question: Question, value: float, known: Sensitivity, least: Least) -> float:
    """By how many per cent the objective is (or would be) worse with the probability than without; infinite where none keeps it.

    value: the objective of the answer to `question`
    """
    if question.probability is None:
        if known.kept >= known.priced:
            return 0.0
        without, kept = value, _found(question.with_(probability=known.priced), least)
    elif question.margin == 1.0:
        return 0.0
    else:
        # the answer keeps the looser limit too, so that without the probability it can only be better
        without, kept = min(_found(question.with_(probability=None, margin=1.0), least), value), value
    return max(100.0 * (kept / without - 1.0), 0.0)


def _found(question: Question, least: Least) -> float:
    try:
        return least(question)
    except OptimisationError:
        return math.inf
