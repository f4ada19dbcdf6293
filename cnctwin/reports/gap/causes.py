"""The causes that were found, in words, with parameters and intervals; then every candidate with its evidence."""

from collections.abc import Sequence

from cnctwin.reports.gap.markup import Markup, each, escaped, joined, scrollable, section, tag
from cnctwin.reports.gap.signal_name import effect_name, effect_phrase, effect_words
from cnctwin.reports.gap.written import interval, known, p_value, share
from twin.effects.effect import Effect
from twin.gap.diagnosis import Candidate, Cause, Diagnosis, Effected, Verdict

CANDIDATES_SHOWN = 10

_NO_CAUSE = {
    Verdict.HEALTHY: "No cause is named: there is no gap that wants one.",
    Verdict.UNKNOWN: "No cause is named: there is a gap, and nothing in the catalogue makes it.",
}


def causes(diagnosis: Diagnosis) -> Markup:
    """The section of the causes."""
    if not diagnosis.causes:
        return section("causes", "What causes it", _NO_CAUSE.get(diagnosis.verdict, "No cause is named."))
    count = len(diagnosis.causes)
    lead = (
        "One effect, added to the twin, is the cause that was found."
        if count == 1
        else f"{count} effects, added to the twin together."
    )
    if diagnosis.verdict is Verdict.PARTLY:
        lead += " What is left has no name."
    return section("causes", "What causes it", lead, *(_cause(cause) for cause in diagnosis.causes))


def _cause(cause: Cause) -> Markup:
    words, effect = effect_words(cause.effect)
    told = [
        tag("dl", _fact("Probability", share(cause.probability)), _fact("Closes", share(cause.closure)), class_="facts"),
        tag("h3", effect_name(cause.effect, cause.on)),
        tag("p", words or "The catalogue of this version has no effect of this name."),
    ]
    if effect is not None:
        told.append(tag("p", tag("code", effect.equation), class_="equation"))
    told.append(_parameters(cause, effect) or Markup(""))
    if cause.indistinguishable_from:
        told.append(
            tag(
                "p",
                tag("strong", "Not told apart from "),
                _or(cause.indistinguishable_from),
                " by these recordings.",
                class_="doubt",
            )
        )
    named = [tag("code", cause.effect)]
    if effect is not None:
        named += [escaped(f" acts on {effect.site.value.replace('_', ' ')} · {effect.reference}")]
    told.append(tag("p", *named, class_="note"))
    return tag("article", *told, class_="cause")


def _fact(term: str, value: str) -> Markup:
    return tag("div", tag("dt", term), tag("dd", value))


def _or(effects: Sequence[Effected]) -> Markup:
    names = [tag("span", effect_phrase(e.effect, e.on), class_="name") for e in effects]
    return names[0] if len(names) == 1 else joined([joined(names[:-1], ", "), " or ", names[-1]])


def _parameters(cause: Cause, effect: Effect | None) -> Markup | None:
    if not cause.parameters:
        return None
    meanings = {p.name: p.meaning for p in effect.parameters} if effect else {}
    rows = []
    for name, given in cause.parameters.items():
        value, between = interval(given)
        cells = (
            tag("td", value, class_="number"),
            tag("td", between, class_="number"),
            tag("td", meanings.get(name, ""), class_="words"),
        )
        rows.append(tag("tr", tag("th", tag("code", name), scope="row"), *cells))
    head = tag("tr", each("th", ("Parameter", "Value", "90 % interval", "Meaning"), scope="col"))
    table = tag("table", tag("thead", head), tag("tbody", *rows), class_="data")
    return scrollable(f"Parameters of {effect_name(cause.effect, cause.on)}", table)


def candidates(diagnosis: Diagnosis) -> Markup:
    """The section of all that was tried; the first ones in sight, the others to be opened."""
    tried = diagnosis.candidates
    if not tried:
        return section("candidates", "What was tried", "No effect was tried.")
    named = {(cause.effect, cause.on) for cause in diagnosis.causes}
    alike = {(e.effect, e.on) for cause in diagnosis.causes for e in cause.indistinguishable_from}
    lead = "Each effect alone: what it closes on runs not fitted, and how likely a healthy machine gives as much."
    rest = None
    if len(tried) > CANDIDATES_SHOWN + 2:
        summary = tag("summary", f"{len(tried) - CANDIDATES_SHOWN} more that were tried")
        rest = tag("details", summary, _candidates(tried[CANDIDATES_SHOWN:], named, alike, "More candidates"))
    shown = tried if rest is None else tried[:CANDIDATES_SHOWN]
    return section("candidates", "What was tried", lead, _candidates(shown, named, alike, "Candidates"), rest)


def _candidates(tried: Sequence[Candidate], named: set[tuple[str, str]], alike: set[tuple[str, str]], label: str) -> Markup:
    rows = []
    for candidate in tried:
        key = (candidate.effect, candidate.on)
        role = "cause" if key in named else "not told apart" if key in alike else ""
        rows.append(
            tag(
                "tr",
                tag("th", effect_name(*key), tag("span", role, class_="role") if role else None, scope="row"),
                tag("td", _length(candidate.closure), class_="draw"),
                tag("td", share(candidate.closure), class_="number"),
                tag("td", p_value(candidate.p_value), class_="number"),
                class_="named" if key in named else None,
            )
        )
    head = tag(
        "tr",
        *(tag("th", h, scope="col", colspan=c) for h, c in (("Effect", None), ("Closes alone", "2"), ("p, if healthy", None))),
    )
    return scrollable(label, tag("table", tag("thead", head), tag("tbody", *rows), class_="data candidates"))


def _length(closure: float) -> Markup:
    width = 100 * min(max(closure, 0.0), 1.0) if known(closure) else 0.0
    bar = tag("rect", x=0, y=4, width=f"{width:.2f}%", height=10, class_="bar")
    return tag(
        "svg", tag("rect", x=0, y=4, width="100%", height=10, class_="track"), bar, width="100%", height=18, aria_hidden="true"
    )
