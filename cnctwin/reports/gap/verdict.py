"""The verdict in one sentence, and the figures that matter. Its sign has a shape of its own, so that it needs no colour."""

from cnctwin.reports.gap.markup import Markup, joined, tag, tile
from cnctwin.reports.gap.sign import DISC, TICK, diamond, drawn, half, ticked
from cnctwin.reports.gap.written import known, share, times
from twin.gap.diagnosis import Diagnosis, GapNumbers, Verdict

_WORD = {
    Verdict.HEALTHY: "Healthy",
    Verdict.EXPLAINED: "Explained",
    Verdict.PARTLY: "Partly explained",
    Verdict.UNKNOWN: "Unknown cause",
}
_QUESTION = "M11.6 12.4a4.5 4.5 0 1 1 6.7 4c-1.6.9-2.3 1.8-2.3 3.4M16 23.6v.3"


def sign(verdict: Verdict) -> Markup:
    """Healthy: a ring with a tick. Explained: a disc with one. Partly: a disc that is half full. Unknown: a diamond that asks."""
    return {
        Verdict.HEALTHY: ticked(),
        Verdict.EXPLAINED: drawn(DISC, tag("path", d=TICK, class_="stroke on")),
        Verdict.PARTLY: half(),
        Verdict.UNKNOWN: diamond(_QUESTION),
    }[verdict]


def headline(diagnosis: Diagnosis, title: str) -> Markup:
    """Return what was looked at, the verdict in a word, and in one sentence."""
    return tag(
        "header",
        tag("p", tag("span", "Sim-to-real gap", class_="kind"), tag("span", title, class_="title"), class_="eyebrow"),
        tag("div", sign(diagnosis.verdict), tag("p", _WORD[diagnosis.verdict], class_="word"), class_="called"),
        tag("h1", diagnosis.sentence or _WORD[diagnosis.verdict]),
        class_=f"verdict {diagnosis.verdict.value}",
    )


def figures(diagnosis: Diagnosis) -> Markup:
    """Gap before and after, what of it is closed, the floor, and the gap as the machine's file states it."""
    gap = diagnosis.gap
    return tag("dl", _change(diagnosis), _closed(diagnosis), _floor(gap), _stated(gap), class_="figures")


def _times(value: float) -> Markup:
    return joined([times(value), tag("small", " ×")]) if known(value) else joined([times(value)])


def _change(diagnosis: Diagnosis) -> Markup:
    gap = diagnosis.gap
    if not diagnosis.causes:
        return tile("Gap", _times(gap.before), "rms of twin − recording, × repeatability")
    arrow = joined([tag("span", " → ", class_="arrow", aria_hidden="true"), tag("span", " to ", class_="unseen")])
    return tile(
        "Gap, before → after", joined([times(gap.before), arrow, _times(gap.after)]), "rms of twin − recording, × repeatability"
    )


def _closed(diagnosis: Diagnosis) -> Markup:
    gap = diagnosis.gap
    if diagnosis.verdict is Verdict.HEALTHY:
        return tile("Closed", "nothing to close", "no gap beyond what repeated runs differ by")
    if not diagnosis.causes:
        return tile("Closed", "nothing", "no effect of the catalogue is its cause")
    between = f"{share(gap.closure_low).removesuffix(' %')} … {share(gap.closure_high)}, with 90 % confidence"
    meaning = between if known(gap.closure_low) and known(gap.closure_high) else "of the gap above the repeatability"
    return tile("Closed of what can be closed", share(gap.closure), meaning)


def _floor(gap: GapNumbers) -> Markup:
    return tile("Repeatability", _times(gap.floor), "what repeated runs of the machine differ by")


def _stated(gap: GapNumbers) -> Markup:
    return tile("Gap of the file as it is", _times(gap.as_stated), "before the constants of the machine's file were refitted")
