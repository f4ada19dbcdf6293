"""The result of a blind check as text: the curves over size, the targets, and each effect."""

from math import inf, isnan

from cnctwin.blind_check.check import CheckResult
from cnctwin.blind_check.scoring import JUDGED_FROM, Scored, Scores

ROWS = (
    ("single effect: named right", "single_right", "≥ 95 %"),
    ("single effect: in the reported class", "single_in_class", "≥ 99 %"),
    ("single effect: a wrong name", "single_wrong", "≤ 2 %"),
    ("outside the catalogue: called unknown", "outside_unknown", "≥ 90 %"),
    ("outside the catalogue: wrongly named", "outside_wrong", "≤ 5 %"),
    ("pair: both right", "pair_both", "≥ 80 %"),
    ("pair: at least one right", "pair_some", ""),
    ("pair: a wrong name", "pair_wrong", ""),
    ("triple: all right", "triple_all", ""),
    ("unseen runs: closure of at least 0.95 of the truth's", "closure_reached", ""),
    ("90 % intervals that cover", "covered", "85–95 %"),
)


def table(result: CheckResult) -> str:
    """The whole result, for reading; shares with their 95 % intervals."""
    found = result.scored
    lines = [
        f"{len(result.cases)} cases, seed {result.seed}, answers sealed as {result.seal}",
        "",
        *_targets(found),
        "",
        *_curve(found),
        "",
        f"single effects from {JUDGED_FROM:g} × the floor on, by effect: named right, in class",
        *(f"  {name:28s} {right!s:24s} {in_class}" for name, (right, in_class) in found.by_effect.items()),
        "",
        f"seconds a case: median {found.seconds_median:.1f}, longest {found.seconds_max:.1f}; in all {result.seconds:.0f} s",
        f"diagnoses that failed: {found.failed}",
    ]
    return "\n".join(lines) + "\n"


def _targets(found: Scored) -> list[str]:
    head = f"{f'from {JUDGED_FROM:g} × the floor on':55s} {'found (95 % interval; count)':32s} target"
    rows = [f"{title:55s} {getattr(found.judged, name)!s:32s} {target}" for title, name, target in ROWS]
    rows.append(f"{'unseen runs: median closure':55s} {_figure(found.judged.closure):32s} ≥ 0.95")
    rows.append(f"{'mean size of a reported class':55s} {_figure(found.judged.class_size):32s}")
    rows.append(f"{'healthy: called healthy':55s} {found.healthy!s:32s} ≥ 98 %")
    rows.append(f"{'healthy: something named':55s} {found.healthy_wrong!s:32s}")
    return [head, *rows]


def _figure(value: float) -> str:
    return "–" if isnan(value) else f"{value:.2f}"


def _curve(found: Scored) -> list[str]:
    """Named right, wrongly named, unknown by size."""
    titles = ("single: right", "single: in class", "single: wrong", "outside: named", "pair: both")
    rows = [f"{'size / floor':12s} " + "".join(f"{title:25s}" for title in titles)]
    for (low, high), scores in found.by_size.items():
        rows.append(f"{_bin(low, high):12s} {_cells(scores)}")
    return rows


def _bin(low: float, high: float) -> str:
    return f"> {low:g}" if high == inf else f"{low:g} to {high:g}"


def _cells(scores: Scores) -> str:
    rates = (scores.single_right, scores.single_in_class, scores.single_wrong, scores.outside_wrong)
    return "".join(f"{rate!s:25s}" for rate in rates) + str(scores.pair_both)
