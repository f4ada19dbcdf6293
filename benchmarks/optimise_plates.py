#!/usr/bin/env python3
"""Measure what an optimiser may claim on ten recorded plates: its predicted times beside the recorded ones first, then the claim.

    .venv/bin/python benchmarks/optimise_plates.py [--json]

One geometry, ten programs with other feeds and spindle speeds for each tool (NIST Smart Manufacturing Systems Test Bed;
CNCTWIN_DATA or ../shared/data). The control is fitted to plates 13, 14 and 15 as in programs/time.py; what is predicted takes the
feeds and speeds of a program and the overrides of its run, and is compared with the active time of that run.

* times: each tool section of each run, predicted and recorded
* savings: an optimiser lives from differences, so the predicted saving of each run against each other beside the recorded one
* the claim: no force was recorded and no constant of the material is known, so that nothing says how much faster a tool
  may cut. Within what was run: for each tool the proven choice that is predicted to be fastest, as one program, with an interval
* left out: the choice is made once more without each plate, and checked on that plate where it ran the same

What proven means is in proven_choices.py.
"""

import argparse
import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.programs.plates import cover_ramp, data_folder, plates
from benchmarks.programs.time import is_fitted
from benchmarks.proven_choices import REFERENCE, Savings, Study, study, wholes


def print_times(found: Study) -> None:
    """The table that comes before any claim."""
    print("predicted and recorded seconds (predicted - recorded); * = fitted")
    for program in found.programs:
        of = [row for row in found.rows if row.run == program.name]
        recorded, predicted = sum(row.recorded_s for row in of), sum(row.predicted_s for row in of)
        star = "*" if is_fitted(program) else " "
        print(f"{program.name:10}{star} {predicted:7.1f} {recorded:7.1f} ({100 * (predicted / recorded - 1):+.2f} %)")
        for row in of:
            notes = [*(["first"] if row.first else []), *(["a knob was turned"] if row.touched else [])]
            notes += ["a part of the section"] if not row.whole else [] if row.proven else ["not proven"]
            figures_s = f"{row.predicted_s:7.1f} {row.recorded_s:7.1f} ({row.error_s:+5.1f})"
            print(f"    T{row.tool:<3} {row.choice!s:16} {figures_s}  {', '.join(notes)}")
    print(f"the optimiser's evaluation of all in one batch differs from the plan by {found.batch_gap_s:.1e} s at most\n")


def print_savings(title: str, several: Sequence[Savings]) -> None:
    """The table of differences."""
    heads = f"{'pairs':>6} {'largest s':>10} {'error s':>8} {'worst s':>8} {'rank':>6} {'right':>8}   {'error s':>8} {'rank':>6}"
    print(f"{title}\n{'':8} {heads}  (length over feed)")
    for one in several:
        model = f"{one.error_s:8.1f} {one.worst_s:8.1f} {one.rank:6.2f} {f'{one.right}/{one.clear}':>8}"
        print(f"{one.name:8} {one.pairs:6} {one.largest_s:10.1f} {model}   {one.feed_error_s:8.1f} {one.feed_rank:6.2f}")
    print()


def print_claim(found: Study) -> None:
    """Print what may be claimed, and what that does not prove."""
    print(f"proven choices, predicted in the order of {REFERENCE} with its knobs (rapid at 52 %), s")
    for tool, options in found.options.items():
        for n, one in enumerate(options):
            more = f"; a tenth more feed would save {found.faster_s[tool]:.1f} s, but nobody ran it" if n == 0 else ""
            print(f"    T{tool:<3} {one.choice!s:16} {one.predicted_s:7.1f}  {', '.join(one.runs)}{more}")
    low, high = found.error
    total = found.best_s
    print(
        f"the fastest of each as one program: {total:.0f} s predicted, 95 % {total / (1 + high):.0f} to {total / (1 + low):.0f} s"
    )
    reference = next(sum(r.recorded_s for r in of) for name, of in wholes(found.rows).items() if name == REFERENCE)
    print(
        f"  {REFERENCE} has these choices or equal ones and was recorded with {reference:.1f} s: against it nothing is claimed\n"
    )
    print("claims: each plate with the choices that the other nine have proven, its own order and knobs; never run like that")
    heads = f"{'recorded':>9} {'predicted':>10} {'with picks':>11} {'saves':>7} {'95 %':>16}"
    print(f"{'plate':11} {heads}   recorded against {REFERENCE}")
    for name in wholes(found.rows):
        of = [one for one in found.checks if one.run == name]
        own, pick, was = (sum(values) for values in zip(*((c.predicted_s, c.pick_s, c.recorded_s) for c in of), strict=True))
        half = found.saved_error[1] * was
        saved, beyond = own - pick, "" if own - pick > half else "  inside the error: no claim"
        range_s = f"{saved - half:6.0f} to {saved + half:5.0f}"
        print(f"{name:11} {was:9.1f} {own:10.1f} {pick:11.1f} {saved:7.1f} {range_s:>16}   {was - reference:7.1f}{beyond}")
    print("\nleft out: sections whose own choice is what the others' proven choices make best, so that its recording checks it")
    same = [check for check in found.checks if check.same]
    for check in same:
        seconds = f"predicted {check.pick_s:6.1f}, recorded {check.recorded_s:6.1f}"
        print(f"    {check.run:10} T{check.tool:<3} {check.pick!s:16} {seconds}")
    off = [check.pick_s - check.recorded_s for check in same]
    mean, apart = statistics.mean(off), statistics.mean(abs(error) for error in off)
    print(f"    {len(same)} of {len(found.checks)}: mean error {mean:+.1f} s, absolute {apart:.1f} s")


def main() -> None:
    """Print the tables, or the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    programs = [one for one in plates(data_folder()) if not one.refusal()]
    found = study(programs, cover_ramp(data_folder()).base_rpm)
    if arguments.json:
        figures_of = {
            "sections": [asdict(row) for row in found.rows],
            "savings": [asdict(pairs) for pairs in (*found.tools, found.whole, found.held_out)],
            "untouched": [asdict(pairs) for pairs in found.untouched],
            "left_out": [asdict(check) for check in found.checks],
        }
        print(json.dumps(figures_of | {"error": found.error, "saved_error": found.saved_error, "best_s": found.best_s}, indent=1))
        return
    print_times(found)
    print_savings("savings between all pairs of runs", [*found.tools, found.whole, found.held_out])
    print_savings("savings between sections in which no knob was turned", found.untouched)
    print_claim(found)


if __name__ == "__main__":
    main()
