"""The result of a blind check as text: the curves over size, the targets, and each effect."""

from dataclasses import fields
from math import inf, isnan
from typing import Any

from cnctwin.blind_check.check import CheckResult
from cnctwin.blind_check.rate import Rate
from cnctwin.blind_check.scoring import JUDGED_FROM, LearnedScores, Scored, Scores

ROWS = (
    ("single effect: named right", "single_right", "≥ 95 %"),
    ("single effect: in the reported class", "single_in_class", "≥ 99 %"),
    ("single effect: a wrong name", "single_wrong", "≤ 2 %"),
    ("outside the catalogue: called so", "outside_unknown", ""),
    ("outside the catalogue: taken up by constants, said so", "outside_taken_up", ""),
    ("outside the catalogue: either of the two", "outside_told", "≥ 95 %"),
    ("outside the catalogue: missed", "outside_missed", "≤ 2 %"),
    ("outside the catalogue: wrongly named", "outside_wrong", "≤ 2 %"),
    ("pair: both right", "pair_both", "≥ 90 %"),
    ("pair: at least one right", "pair_some", ""),
    ("pair: a wrong name", "pair_wrong", ""),
    ("triple: all right", "triple_all", "≥ 80 %"),
    ("unseen runs: closure of at least 0.95 of the truth's", "closure_reached", ""),
    ("90 % intervals that cover", "covered", "85–95 %"),
)

CURVE = (
    ("single: right", "single_right"),
    ("single: in class", "single_in_class"),
    ("single: wrong", "single_wrong"),
    ("outside: called so", "outside_unknown"),
    ("outside: missed", "outside_missed"),
    ("outside: named", "outside_wrong"),
    ("pair: both", "pair_both"),
)
"""The shares that are shown over the size of the effect."""


def table(result: CheckResult) -> str:
    """The whole result, for reading; shares with their 95 % intervals."""
    found = result.scored
    sealed = result.seal or "– (not all are drawn)"
    lines = [
        f"{len(result.cases)} of {result.asked} cases, seed {result.seed}, answers sealed as {sealed}",
        "",
        *_targets(found),
        "",
        *_controllers(found),
        "",
        *_curve(found),
        "",
        f"single effects from {JUDGED_FROM:g} × the floor on, by effect: named right, in class",
        *(f"  {name:28s} {right!s:24s} {in_class}" for name, (right, in_class) in found.by_effect.items()),
        "",
        f"seconds of this run: {result.seconds:.0f}",
        f"diagnoses that failed: {found.failed}",
        *_failures(result),
    ]
    return "\n".join(lines) + "\n"


def _failures(result: CheckResult) -> list[str]:
    """Say what went wrong with questions and diagnoses, and where states of the program are mixed."""
    lines = [f"  {case.answer.name}: {case.given.failed}" for case in result.cases if case.given.failed]
    if result.redrawn:
        lines += [f"questions drawn again: {len(result.redrawn)}", *(f"  {said}" for said in result.redrawn)]
    if result.undrawn:
        lines += [f"questions that could not be drawn: {', '.join(result.undrawn)}"]
    if len(result.programs) > 1:
        lines += [f"states of the program that diagnosed them: {', '.join(sorted(result.programs))}"]
    return lines


def check_json(result: CheckResult) -> dict[str, Any]:
    """The result for a program to read; each share with its hits, count and 95 % interval."""
    found = result.scored

    def plain(scores: Scores | LearnedScores) -> dict[str, Any]:
        values = {f.name: getattr(scores, f.name) for f in fields(scores)}
        return {name: _rate(v) if isinstance(v, Rate) else None if isnan(v) else v for name, v in values.items()}

    return {
        "cases": len(result.cases),
        "asked": result.asked,
        "redrawn": list(result.redrawn),
        "undrawn": list(result.undrawn),
        "programs": sorted(result.programs),
        "seed": result.seed,
        "seal": result.seal,
        "salt": result.salt,
        "judged_from": JUDGED_FROM,
        "judged": plain(found.judged),
        "nominal_controller": plain(found.nominal),
        "other_controller": plain(found.other_controller) | {"told": _rate(found.controller_told)},
        "learned": plain(found.learned),
        "healthy": _rate(found.healthy),
        "healthy_wrong": _rate(found.healthy_wrong),
        "by_size": [{"low": low, "high": None if high == inf else high, **plain(s)} for (low, high), s in found.by_size.items()],
        "by_effect": {name: {"right": _rate(a), "in_class": _rate(b)} for name, (a, b) in found.by_effect.items()},
        "failed": _rate(found.failed),
        "seconds_median": found.seconds_median,
        "seconds_max": found.seconds_max,
        "seconds": result.seconds,
    }


def _rate(rate: Rate) -> dict[str, Any]:
    share = None if isnan(rate.share) else rate.share
    return {"hits": rate.hits, "count": rate.count, "share": share, "low": rate.low, "high": rate.high}


def missed(result: CheckResult) -> tuple[str, ...]:
    """The targets that this check shows to be missed: a whole 95 % interval on the wrong side."""
    found = result.scored
    least = {"single_right": 0.95, "single_in_class": 0.99, "outside_told": 0.95, "pair_both": 0.90, "triple_all": 0.80}
    most = {"single_wrong": 0.02, "outside_wrong": 0.02, "outside_missed": 0.02}
    said = [name for name, target in least.items() if (r := getattr(found.judged, name)).count and r.high < target]
    said += [name for name, target in most.items() if (r := getattr(found.judged, name)).count and r.low > target]
    site, variables = found.learned.site, found.learned.variables
    said += ["site"] if site.count and site.high < 0.90 else []
    said += ["variables"] if variables.count and variables.high < 0.80 else []
    said += ["healthy"] if found.healthy.count and found.healthy.high < 0.98 else []
    return tuple(said)


def _targets(found: Scored) -> list[str]:
    head = f"{f'from {JUDGED_FROM:g} × the floor on':55s} {'found (95 % interval; count)':32s} target"
    return [head, *(f"{title:55s} {value:32s} {target}".rstrip() for title, value, target in target_rows(found))]


def target_rows(found: Scored) -> list[tuple[str, str, str]]:
    """Return what is scored, what was found, and the target, where there is one."""
    rows = [(title, str(getattr(found.judged, name)), target) for title, name, target in ROWS]
    return [
        *rows,
        ("outside, called so: its site right", str(found.learned.site), "≥ 90 %"),
        ("outside, called so: site and variables right", str(found.learned.variables), "≥ 80 %"),
        ("outside, called so: median closure, unseen runs", _figure(found.learned.closure), "≥ 0.80"),
        ("unseen runs: median closure", _figure(found.judged.closure), "≥ 0.95"),
        ("mean size of a reported class", _figure(found.judged.class_size), ""),
        ("healthy: called healthy", str(found.healthy), "≥ 98 %"),
        ("healthy: something named", str(found.healthy_wrong), ""),
        ("seconds a case: median", f"{found.seconds_median:.1f}", "≤ 30"),
        ("seconds a case: longest", f"{found.seconds_max:.1f}", "≤ 90"),
    ]


def controller_rows(found: Scored) -> list[tuple[str, str, str]]:
    """Return what is scored, of machines with the controller that they state, and of those with another one."""
    names = ("single_right", "single_wrong", "outside_told", "outside_wrong", "pair_both", "pair_wrong", "triple_all")
    titles = {name: title for title, name, _ in ROWS}
    rows = [(titles[name], str(getattr(found.nominal, name)), str(getattr(found.other_controller, name))) for name in names]
    return [*rows, ("another controller is named, or called not understood", "", str(found.controller_told))]


def _controllers(found: Scored) -> list[str]:
    head = f"{f'from {JUDGED_FROM:g} × the floor on, by controller':55s} {'as stated':25s} another structure"
    return [head, *(f"{title:55s} {stated:25s} {other}" for title, stated, other in controller_rows(found))]


def _figure(value: float) -> str:
    return "–" if isnan(value) else f"{value:.2f}"


def _curve(found: Scored) -> list[str]:
    """The scores by size."""
    rows = [f"{'size / floor':12s} " + "".join(f"{title:25s}" for title, _ in CURVE).rstrip()]
    for (low, high), scores in found.by_size.items():
        size = f"> {low:g}" if high == inf else f"{low:g} to {high:g}"
        rows.append(f"{size:12s} " + "".join(f"{getattr(scores, name)!s:25s}" for _, name in CURVE).rstrip())
    return rows
