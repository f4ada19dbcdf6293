"""The tables of docs/explanation/gap-results.md from the folder of a blind check, as Markdown, and its size curve as a picture.

    .venv/bin/python benchmarks/gap/publish.py FOLDER [--left-out FOLDER] [--picture docs/pictures/gap-size-curve.svg]

FOLDER is that of `cnctwin gap check --keep`, finished or not. Baselines that ran in it (`benchmarks/gap/blind_check.py`) get a
table beside the diagnosis, on the cases that all of them have done. --left-out: that of `benchmarks/gap/leave_one_out.py`.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from math import inf
from pathlib import Path

from benchmarks.gap import leave_one_out
from benchmarks.gap.size_curve import picture
from cnctwin.blind_check.check import CheckResult, result_of
from cnctwin.blind_check.kept import Kept, read_kept
from cnctwin.blind_check.scoring import JUDGED_FROM, Scored, scored
from cnctwin.blind_check.table import CURVE, ROWS, controller_rows, target_rows

FROM = f"from {JUDGED_FROM:g} × the floor on"
BASELINES = ("bic", "lasso", "forest")


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table.

    >>> print(markdown(("", "found"), [("right", "3 of 4")]))
    | | found |
    |---|---|
    | right | 3 of 4 |
    """
    lines = [head, *rows]
    text = ["|" + "|".join(f" {cell} " if cell else " " for cell in line) + "|" for line in lines]
    return "\n".join([text[0], "|" + "---|" * len(head), *text[1:]])


def by_size(found: Scored) -> str:
    """Return the size curve as a table."""
    titles = [title for title, _ in CURVE]
    rows = []
    for (low, high), scores in found.by_size.items():
        size = f"above {low:g}" if high == inf else f"{low:g} to {high:g}"
        rows.append((size, *(str(getattr(scores, name)) for _, name in CURVE)))
    return markdown(("size / floor", *titles), rows)


def tables(result: CheckResult) -> str:
    """Return the tables of one method."""
    found = result.scored
    effects = [(f"`{name}`", str(right), str(in_class)) for name, (right, in_class) in found.by_effect.items()]
    parts = [
        f"{len(result.cases)} of {result.asked} cases, seed {result.seed}, sealed as `{result.seal}`, salt `{result.salt}`; "
        f"shares with 95 % intervals. Questions drawn again: {len(result.redrawn)}; not to be drawn: {len(result.undrawn)}; "
        f"diagnoses that failed: {found.failed}. Each case had one core.",
        markdown((FROM, "found (95 % interval; count)", "target"), target_rows(found)),
        markdown((f"{FROM}, by controller", "as stated", "another structure"), controller_rows(found)),
        by_size(found),
        markdown((f"single effects {FROM}", "named right", "in the reported class"), effects),
    ]
    if len(result.programs) > 1:
        parts.append(f"States of the program that diagnosed them: {', '.join(sorted(result.programs))}.")
    return "\n\n".join(parts)


def beside(kept: Kept) -> str:
    """Return the scores of the diagnosis and of the baselines on the cases that all of them have done; empty without any."""
    results = {name: result_of(kept, name) for name in ("diagnosis", *BASELINES)}
    done = {name: result for name, result in results.items() if result.cases}
    if len(done) < 2:
        return ""
    shared = set.intersection(*({case.answer.name for case in result.cases} for result in done.values()))
    found = {name: scored([case for case in r.cases if case.answer.name in shared]) for name, r in done.items()}
    rows = [(title, *(str(getattr(one.judged, name)) for one in found.values())) for title, name, _ in ROWS]
    rows.append(("healthy: called healthy", *(str(one.healthy) for one in found.values())))
    return f"On {len(shared)} cases that all have done:\n\n" + markdown((FROM, *found), rows)


def left_out(folder: Path) -> str:
    """Return the table of the study that leaves each effect out."""
    result = result_of(read_kept(folder), "left_out")
    learned, named = leave_one_out.rates(result)
    head = ("left out", *leave_one_out.OUTCOMES, "names that were given")
    said = f"{len(result.cases)} of {result.asked} cases. {FROM}: learned at the right site {learned}, named {named}."
    return said[:1].upper() + said[1:] + "\n\n" + markdown(head, leave_one_out.rows(result))


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="The tables of docs/explanation/gap-results.md.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--left-out", type=Path)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args(arguments)
    kept = read_kept(given.folder)
    result = result_of(kept, "diagnosis")
    parts = [tables(result), beside(kept), left_out(given.left_out) if given.left_out else ""]
    sys.stdout.write("\n\n".join(filter(None, parts)) + "\n")
    if given.picture:
        title = f"The blind check over the size of the effect: {len(result.cases)} cases, seed {result.seed}"
        given.picture.write_text(picture(result.scored, title), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
