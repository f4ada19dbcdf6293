"""The blind check as a study: the gap diagnosis beside three baselines, on the same sealed cases.

    .venv/bin/python benchmarks/gap/blind_check.py --cases 600 --seed 1 --workers 2 [--only ours bic lasso forest] [--out
    result.txt]

Prints accuracy as a curve over the size of the effect, with intervals, method by method. Takes a minute a case and worker or so;
the baselines some seconds of it. The forest is trained on machines that the twin simulates, of other seeds than the check's.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.gap import baselines as gap_baselines
from cnctwin.blind_check.case_folder import write_case
from cnctwin.blind_check.check import Diagnose, run_checks
from cnctwin.blind_check.question import Sort, draw
from cnctwin.blind_check.table import table
from twin.case import read_case

METHODS = ("ours", "bic", "lasso", "forest")
TRAINING_SEED = 10_000_019
"""Its programs and machines are not those of a check; of the reference machine only commands and stated figures are used."""


def ours() -> Diagnose:
    """The diagnosis itself."""
    from twin.gap.diagnose import diagnose  # noqa: PLC0415 - the baselines can be run without it

    return diagnose


def trained(machines: int, each: int) -> Diagnose:
    """A random forest, trained on `each` simulated machines for each of so many stated ones."""
    with tempfile.TemporaryDirectory(prefix="blind-check-") as folder:
        cases = []
        for question in draw(machines, TRAINING_SEED, Sort.HEALTHY):
            write_case(Path(folder) / question.name, question)
            cases.append(read_case(Path(folder) / question.name))
        diagnose: Diagnose = gap_baselines.random_forest(gap_baselines.forest_of(cases, each, TRAINING_SEED))
        return diagnose


def main(arguments: list[str] | None = None) -> int:
    """Run the study and print its tables."""
    parser = argparse.ArgumentParser(description="The gap diagnosis and three baselines on sealed cases.")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--training-machines", type=int, default=24)
    parser.add_argument("--training-each", type=int, default=80)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args(arguments)
    methods: dict[str, Diagnose] = {}
    for name in given.only:
        if name == "ours":
            methods[name] = ours()
        elif name == "forest":
            sys.stderr.write("training the forest\n")
            methods[name] = trained(given.training_machines, given.training_each)
        else:
            methods[name] = {"bic": gap_baselines.smallest_bic, "lasso": gap_baselines.sparse_regression}[name]
    results = run_checks(
        given.cases, given.seed, methods, workers=given.workers, progress=lambda said: print(said, file=sys.stderr, flush=True)
    )
    text = "\n\n".join(f"## {name}\n{table(result)}" for name, result in results.items())
    sys.stdout.write(text)
    if given.out is not None:
        given.out.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
