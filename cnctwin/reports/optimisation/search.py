"""The search: its course, and what it would take to do it again."""

import numpy as np

from cnctwin.reports.gap.chart import Frame, frame_of, panel, path, x_axis
from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.gap.written import figure, known
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import quantity, shortened
from cnctwin.reports.optimisation.totals import bounds
from twin.optimisation.answer import Objective, Optimised

HEIGHT = 150
COLUMNS = 240


def search(answer: Optimised) -> Markup:
    """The section."""
    given = answer.search
    facts = (
        ("Method", shortened(given.method, 300)),
        ("Seed", f"{given.seed}; the same seed gives the same answer"),
        ("Population", f"{given.population:,}"),
        ("Evolutions", f"{given.evolutions:,}"),
        ("Evaluations", f"{given.evaluations:,} simulated programs"),
        ("Took", quantity(given.seconds, "s", 3)),
    )
    listed = tag("dl", *(tag("div", tag("dt", term), tag("dd", text)) for term, text in facts), class_="method")
    return section("search", "How it was found", _lead(answer), *_chart(answer), listed)


def _lead(answer: Optimised) -> str:
    done = counted(answer.search.evaluations, "evaluation")
    history = [value for value in answer.search.history if known(value)]
    if len(history) < 2:
        return f"{done}."
    last = next(n for n, value in enumerate(history) if abs(value - history[-1]) <= 1e-3 * abs(history[-1]))
    if last == 0:
        return f"{done}; it began within 0.1 % of where it ended, from what it was seeded with."
    return f"{done}; from evolution {last + 1:,} of {len(history):,} on it was within 0.1 % of where it ended."


def _chart(answer: Optimised) -> list[Markup]:
    history = np.array(answer.search.history, dtype=float)
    history = np.where(np.isfinite(history), history, np.nan)
    if int(np.isfinite(history).sum()) < 2:
        return []
    of = {"time": "best time, s", "cost": f"best cost, {answer.currency}"}.get(str(answer.objective), "hypervolume of the front")
    bound = answer.bound.value
    shown = answer.objective is not Objective.PARETO and bounds(answer) != "" and known(bound)
    shown = shown and abs(float(np.nanmin(history)) - bound) <= 2.0 * float(np.nanmax(history) - np.nanmin(history))
    at = np.arange(1.0, len(history) + 1.0)
    frame = frame_of(at, [history, np.array([bound])] if shown else [history], HEIGHT)
    drawn = [tag("path", d=path(frame, at, history, COLUMNS), class_="line after")]
    label = f"{of}, after each evolution"
    if shown:
        drawn.append(tag("path", d=f"M0 {float(frame.y(np.array([bound]))[0]):.1f}H1000", class_="limit"))
        label += f"; dots: the bound, {figure(bound, 5)}"
    digits = 3 + max(0, _same_digits(frame))
    axis = tag("div", x_axis(frame, "evolution"), class_="panel time")
    body = tag("div", panel(frame, label, joined(drawn), digits), axis, class_="charts", role="img", aria_label=label)
    return [tag("figure", body, class_="trace")]


def _same_digits(frame: Frame) -> int:
    """Return how many leading digits the labels share, so that they can be told apart.

    >>> _same_digits(Frame(0, 1, 24.50, 24.60, 100))
    2
    """
    wide, size = frame.top - frame.bottom, max(abs(frame.top), abs(frame.bottom))
    return min(4, int(np.floor(np.log10(size / wide)))) if wide > 0.0 and size > 0.0 else 0
