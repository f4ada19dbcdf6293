"""The result in one sentence, and the figures that matter. The sign has a shape of its own, so that it needs no colour."""

import math

from cnctwin.reports.gap.markup import Markup, joined, tag, tile
from cnctwin.reports.gap.sign import diamond, half, ticked
from cnctwin.reports.gap.written import figure
from cnctwin.reports.optimisation.quantity import (
    change,
    column,
    length_of_time,
    limit_text,
    percent,
    probability,
    shortened,
    to,
    written_s,
)
from twin.optimisation.answer import Objective, Optimised, Sensitivity

_WARNING = "M16 8.5v10M16 22.6v.4"


def headline(answer: Optimised) -> Markup:
    """Return what was optimised, whether every limit is kept, and the sentence."""
    kept, known = answer.after.over == 0 and not answer.collisions, answer.sensitivity
    unsure = kept and known is not None and known.is_unsure
    word = _kept_in_words(answer) if kept else f"{counted(answer.after.over, 'line')} above a limit"
    if answer.collisions:
        word = f"A rapid goes into material in line {answer.collisions[0]:,}"
    machine = f"by the twin of {shortened(answer.machine)}" if answer.machine else ""
    return tag(
        "header",
        tag(
            "p",
            tag("span", "Feed and speed for each line", class_="kind"),
            tag("span", shortened(answer.name, 120), class_="title"),
            tag("span", f"{machine}, least {answer.objective}" if answer.objective != "pareto" else f"{machine}, time and cost"),
            class_="eyebrow",
        ),
        tag(
            "div",
            half() if unsure else _sign(kept),
            tag("p", word, tag("span", ", as modelled", class_="quiet"), class_="word"),
            class_="called",
        ),
        tag("h1", shortened(answer.sentence, 600).replace(" %", "\u00a0%") or word),
        class_=f"verdict {'unsure' if unsure else 'healthy' if kept else 'over'}",
    )


def _kept_in_words(answer: Optimised) -> str | Markup:
    """Return how surely the limits are kept, and what it costs to keep that of force more surely than it is."""
    known = answer.sensitivity
    if known is None:
        return "All limits kept"
    if not known.is_unsure:
        return f"All limits kept, that of force with {probability(known.kept)} probability"
    said = f"The force limit is kept with {probability(round(known.kept, 2))} probability"
    if not known.identified:
        said += ", and none of its constants was identified"
    return joined([f"{said}; ", *_more_surely(answer, known)])


def _more_surely(answer: Optimised, known: Sensitivity) -> list[str]:
    """Return what keeping the force limit more surely would cost, the option as a person types it."""
    if known.asked is not None:
        return [f"{probability(known.asked)} was asked for"]
    if not math.isfinite(known.price_pct):
        return [f"no program is known that keeps it with {probability(known.priced)}"]
    how_much = "no" if known.price_pct < 0.05 else f"{figure(known.price_pct, 2)} %"
    what = " time" if answer.objective is Objective.TIME else ""
    return [tag("code", f"--probability {known.priced:g}"), f" costs {how_much} more{what}"]


def _sign(kept: bool) -> Markup:
    """A ring with a tick, or a diamond with an exclamation mark."""
    return ticked() if kept else diamond(_WARNING)


def counted(count: int, noun: str) -> str:
    """
    >>> counted(1, "line"), counted(5000, "line")
    ('1 line', '5,000 lines')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def figures(answer: Optimised) -> Markup:
    """Time, cost, force, how far from the bound, and how surely the limit is kept; those that there are."""
    before, after = answer.before, answer.after
    spoken = length_of_time(after.seconds)
    tiles = [
        tile(
            "Time, s",
            to(written_s(before.seconds), written_s(after.seconds)),
            change(before.seconds, after.seconds) + (f", now {spoken}" if spoken else ""),
        )
    ]
    if after.cost is not None:
        cost = to(column(before.cost), column(after.cost))
        tiles.append(tile(f"Cost, {answer.currency}", cost, f"{change(before.cost, after.cost)}, tool wear included"))
    limit = limit_text(answer.limits, "force")
    force = to(column(before.force_n, 3), column(after.force_n, 3))
    tiles.append(
        tile("Greatest resultant force, N", force, f"limit {shortened(limit, 60)}" if limit else "no limit of force was set")
    )
    reached = "which a program reaches: exact" if answer.bound.exact else "which no program can beat"
    tiles.append(tile("Above the bound", percent(answer.bound.distance), reached))
    if answer.sensitivity is not None:
        asked = answer.sensitivity.asked
        wanted = "planned with the constants as stated" if asked is None else f"{probability(asked)} was asked for"
        tiles.append(tile("Force limit kept with", probability(answer.sensitivity.kept), wanted))
    return tag("dl", *tiles, class_="figures tiles")
