"""The rest of a diagnosis: what cannot be told, what to run next, what else was found, and how it was judged."""

from collections.abc import Iterable

from cnctwin.reports.gap.markup import Markup, each, joined, section, tag
from cnctwin.reports.gap.signal_name import effect_name, effect_phrase
from cnctwin.reports.gap.written import figure, known, stated, times
from twin.gap.diagnosis import Diagnosed, Diagnosis, Verdict


def cannot_be_told(diagnosis: Diagnosis) -> Markup:
    """The section of what these recordings are silent about."""
    blocks = [
        _block("Not told apart", _alike(diagnosis), "None was found."),
        _block("Not identifiable", diagnosis.not_identifiable, "None was found."),
        _block("Not observable", _unseen(diagnosis), "None was found."),
    ]
    return section("untold", "What cannot be told", None, tag("div", *blocks, class_="columns"))


def _block(title: str, points: Iterable[str], none: str) -> Markup:
    items = each("li", points)
    return tag("div", tag("h3", title), tag("ul", items) if items else tag("p", none, class_="quiet"))


def _alike(diagnosis: Diagnosis) -> list[str]:
    return [
        " or ".join([effect_name(cause.effect, cause.on), *(effect_phrase(e.effect, e.on) for e in cause.indistinguishable_from)])
        for cause in diagnosis.causes
        if cause.indistinguishable_from
    ]


def _unseen(diagnosis: Diagnosis) -> list[Markup]:
    """Effects that are not observable for the same reason are one point."""
    by_reason: dict[str, list[str]] = {}
    for item in diagnosis.not_observable:
        by_reason.setdefault(item.why, []).append(item.effect)
    return [joined([_listed(names), tag("span", f" – {why}", class_="quiet")]) for why, names in by_reason.items()]


def _listed(effects: list[str]) -> str:
    return ", ".join([effect_name(effects[0]), *map(effect_phrase, effects[1:])])


def next_experiment(diagnosis: Diagnosis) -> Markup:
    """The section of the program to run next."""
    given = diagnosis.next_experiment
    if given is None:
        closed = diagnosis.verdict in (Verdict.HEALTHY, Verdict.EXPLAINED) and not _alike(diagnosis)
        lead = (
            "There is no need of one: nothing is left open that a program could tell."
            if closed
            else "No program is known that would tell more."
        )
        return section("next", "Next experiment", lead)
    facts = []
    if known(given.seconds) and given.seconds > 0:
        facts.append(f"It takes about {figure(given.seconds, 2)} s.")
    if known(given.separation) and given.separation > 0:
        facts.append(f"The hypotheses then lie {times(given.separation)} times the repeatability apart.")
    facts.append("Look at the program before it runs: it knows the stated travel, not what is clamped on the table.")
    button = tag("button", "Copy", type="button", class_="copy", data_copy="nc", hidden=True)
    code = tag(
        "pre", tag("code", given.program), id="nc", tabindex="0", role="region", aria_label="G-code of the next experiment"
    )
    note = tag("p", " ".join(facts), class_="note")
    return section(
        "next", "Next experiment", stated(given.why), tag("div", button, code, class_="program") if given.program else None, note
    )


def notes(diagnosis: Diagnosis) -> Markup | None:
    """The section of what else was found on the way."""
    return section("notes", "Notes", None, tag("ul", each("li", map(stated, diagnosis.notes)))) if diagnosis.notes else None


def judged(diagnosed: Diagnosed) -> Markup:
    """The section that says what the figures are."""
    diagnosis, gap = diagnosed.diagnosis, diagnosed.diagnosis.gap
    used: dict[bool, list[str]] = {True: [], False: []}
    for trace in diagnosed.traces:
        if trace.run not in used[trace.fitted]:
            used[trace.fitted].append(trace.run)
    floor = (
        "What repeated runs of the same program differ by, rms over √2, signal by signal; where none were repeated, what the "
        "noise of the sensors makes. A gap of 1 × is no gap."
    )
    refitted = (
        "With the machine's constants refitted within their stated uncertainty, which is no cause: from "
        f"{times(gap.as_stated)} × with those of the machine's file to {times(gap.before)} ×."
    )
    facts = [
        ("Repeatability", floor),
        ("Before", refitted),
        (
            "Closed",
            "1 − (after² − 1) / (before² − 1), as multiples of the repeatability: the share gone of what is above.",
        ),
        ("Not fitted", ", ".join(used[False]) or "No run was kept back."),
        ("Fitted", ", ".join(used[True]) or "No run of those shown."),
        ("Machine", diagnosed.twin.machine.name),
        ("Time", f"{figure(diagnosis.seconds, 2)} s" if known(diagnosis.seconds) else "Not measured."),
    ]
    return section(
        "judged",
        "How it was judged",
        None,
        tag("dl", *(tag("div", tag("dt", k), tag("dd", v)) for k, v in facts), class_="method"),
    )
