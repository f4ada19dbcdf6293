"""Each effect is taken from the catalogue in turn: what is found on machines that have it must be learned, and not named.

    .venv/bin/python benchmarks/gap/leave_one_out.py --each 4 --seed 2 --keep FOLDER [--workers 2] [--only backlash runout]

Of each effect of the reference machine that the catalogue has, so many single cases are drawn, and diagnosed with that effect
left out of the catalogue. From two floors on a case is right where no cause is named and the learned term that closes most acts
at the effect's site. It goes on where it stopped in FOLDER. Exit code 1: a wrong name.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cnctwin.blind_check.check import CheckResult, run_checks
from cnctwin.blind_check.question import Draft, Sort, names
from cnctwin.blind_check.rate import Rate, rate_of
from cnctwin.blind_check.scoring import JUDGED_FROM, Judged
from cnctwin.jobs.spread import spread_over
from twin.case import Case
from twin.effects.catalogue import effect_named
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosed, Verdict
from twin.sites import Site

METHOD = {"left_out": "benchmarks.gap.leave_one_out:without_its_own"}
FORCE = frozenset({"axis_force"})
TABLE = frozenset({"table_position", "table_reading"})
SITES = {
    Site.PROGRAM: frozenset({"program_time"}),
    Site.REFERENCE: frozenset({"controller"}),
    Site.CONTROLLER: frozenset({"controller"}),
    Site.DRIVE_FORCE: FORCE,
    Site.FRICTION: FORCE | {"friction"},
    Site.PROCESS_FORCE: frozenset({"cut_force"}),
    Site.SPINDLE: frozenset({"spindle_power"}),
    Site.THERMAL: frozenset({"heat_input", "heat_loss"}),
    Site.CLOCK: frozenset({"position_reading"}),
}
"""Site of an effect → sites of a learned term (formats, section 6) that describe it equally well."""
MECHANICS = {"external_force_n": FORCE | {"torque_reading"}, "moving_mass_kg": FORCE, "table_mm": TABLE}
"""The same of the mechanics, by the quantity that the effect changes; a constant force is also a bias of the torque."""
READINGS = {
    "table_mm": TABLE,
    "pos_mm": frozenset({"position_reading"}),
    "torque_a": FORCE | {"torque_reading"},
    "x_n": frozenset({"cut_force", "force_reading"}),
    "y_n": frozenset({"cut_force", "force_reading"}),
    "load_pct": frozenset({"spindle_power"}),
    "temp_c": frozenset({"temperature_reading"}),
}
"""The same of a sensor, by the end of the name of the signal."""


def sites_of(effect: str, on: str) -> frozenset[str]:
    """Return the sites at which a learned term describes an effect of the catalogue.

    >>> sorted(sites_of("backlash", "x")), sorted(sites_of("sensor_lag", "x_torque_a"))
    (['table_position', 'table_reading'], ['axis_force', 'torque_reading'])
    """
    found = effect_named(effect)
    if found.site is Site.SENSOR:
        return READINGS[next(end for end in READINGS if on.endswith(end))] if "_" in on else TABLE
    if found.site is Site.MECHANICS:
        return frozenset().union(*(MECHANICS[quantity] for quantity in found.changes))
    return SITES[found.site]


def without_its_own(case: Case) -> Diagnosed:
    """Diagnose a case with the effect left out of the catalogue that its name begins with."""
    return diagnose(case, without=frozenset({case.name.rpartition("-")[0]}))


def drafts_of(effects: Sequence[str], each: int, seed: int) -> tuple[Draft, ...]:
    """Return the cases: of each effect the same ones whichever else are asked."""
    numbers = {name: i for i, name in enumerate(names(named=True))}
    return tuple(
        Draft(f"{effect}-{n + 1}", Sort.SINGLE, int(np.random.default_rng([seed, numbers[effect], n]).integers(2**31)), effect)
        for effect in effects
        for n in range(each)
    )


def outcome(case: Judged) -> str:
    """Say in one word what became of a case: `learned` is right, `named` is wrong."""
    given, effect = case.given, case.answer.effects[0]
    if given.failed:
        return "failed"
    if given.causes:
        return "named"
    if given.learned:
        term = given.learned[0]
        same_axis = not (term.on and effect.on) or term.on[:1] == effect.on[:1]
        return "learned" if same_axis and term.site in sites_of(effect.effect, effect.on) else "elsewhere"
    if given.closure_unseen is not None and given.closure_unseen >= 0.95:
        return "constants"
    return "missed" if given.verdict is Verdict.HEALTHY else "unknown"


OUTCOMES = ("learned", "elsewhere", "unknown", "constants", "missed", "named", "failed")


def rows(result: CheckResult) -> list[tuple[str, ...]]:
    """Return a row for each effect, and one for all: the name, how many cases ended how, and the names that were given."""
    seen = [case for case in result.cases if case.answer.size >= JUDGED_FROM]
    table = []
    for name in sorted({case.answer.effects[0].effect for case in seen}):
        own = [case for case in seen if case.answer.effects[0].effect == name]
        wrong = [", ".join(f"{effect} on {on}" if on else effect for effect, on in sorted(case.names)) for case in own]
        table.append((name, *_counts(own), "; ".join(filter(None, wrong))))
    return [*table, ("all", *_counts(seen), "")]


def _counts(cases: Sequence[Judged]) -> tuple[str, ...]:
    ends = [outcome(case) for case in cases]
    return tuple(str(ends.count(end)) for end in OUTCOMES)


def rates(result: CheckResult) -> tuple[Rate, Rate]:
    """Return the shares of the cases from two floors on that are learned at the right site, and that are named."""
    ends = [outcome(case) for case in result.cases if case.answer.size >= JUDGED_FROM]
    return rate_of(end == "learned" for end in ends), rate_of(end == "named" for end in ends)


def main(arguments: list[str] | None = None) -> int:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description="Each effect of the catalogue left out in turn.")
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--keep", type=Path, required=True, help="folder of what is done")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=names(named=True), default=list(names(named=True)))
    given = parser.parse_args(arguments)
    with spread_over(given.workers) as spread:
        result = run_checks(
            drafts_of(given.only, given.each, given.seed),
            METHOD,
            given.keep,
            seed=given.seed,
            spread=spread,
            progress=lambda said: print(said, file=sys.stderr, flush=True),
        )["left_out"]
    learned, named = rates(result)
    print(f"{'left out':28s} " + "".join(f"{end:>10s}" for end in OUTCOMES) + "  named")
    for name, *counts, wrong in rows(result):
        print(f"{name:28s} " + "".join(f"{count:>10s}" for count in counts) + f"  {wrong}")
    print(f"\nfrom {JUDGED_FROM:g} × the floor on: learned at the right site {learned}, named {named}")
    return 1 if named.hits else 0


if __name__ == "__main__":
    sys.exit(main())
