"""The blind check as a study: the gap diagnosis beside three baselines, on the same sealed cases.

    .venv/bin/python benchmarks/gap/blind_check.py --cases 600 --seed 1 --keep FOLDER [--workers 2] [--only diagnosis bic]

Prints accuracy as a curve over the size of the effect, with intervals, method by method. It goes on where it stopped in FOLDER,
which may be that of `cnctwin gap check --keep`: what the diagnosis has done there is not done again. The forest is
trained on machines that the twin simulates, of other seeds than the check's, once in each process.
"""

import argparse
import sys
import tempfile
from functools import cache
from pathlib import Path

from sklearn.ensemble import RandomForestClassifier

from benchmarks.gap import baselines
from cnctwin.blind_check.case_folder import write_case
from cnctwin.blind_check.check import run_checks
from cnctwin.blind_check.question import Sort, drafts, draw
from cnctwin.blind_check.table import table
from cnctwin.jobs.spread import spread_over
from twin.case import Case, read_case
from twin.gap.diagnosis import Diagnosed

METHODS = {
    "diagnosis": "cnctwin.batch.diagnosis:diagnosed_alone",
    "bic": "benchmarks.gap.baselines:smallest_bic",
    "lasso": "benchmarks.gap.baselines:sparse_regression",
    "forest": "benchmarks.gap.blind_check:by_trained_forest",
}
TRAINING_SEED = 10_000_019
"""Its programs and machines are not those of a check; of the reference machine only commands and stated figures are used."""
TRAINING_MACHINES, TRAINING_EACH = 24, 80


@cache
def trained() -> RandomForestClassifier:
    """Return a random forest, trained on so many simulated machines for each of so many stated ones."""
    sys.stderr.write("training the forest\n")
    with tempfile.TemporaryDirectory(prefix="blind-check-") as folder:
        cases = []
        for question in draw(TRAINING_MACHINES, TRAINING_SEED, Sort.HEALTHY):
            write_case(Path(folder) / question.name, question)
            cases.append(read_case(Path(folder) / question.name))
        return baselines.forest_of(cases, TRAINING_EACH, TRAINING_SEED)


def by_trained_forest(case: Case) -> Diagnosed:
    """Name what the forest names."""
    return baselines.by_forest(trained(), case)


def main(arguments: list[str] | None = None) -> int:
    """Run the study and print its tables."""
    parser = argparse.ArgumentParser(description="The gap diagnosis and three baselines on sealed cases.")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, required=True, help="folder of what is done")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=METHODS, default=list(METHODS))
    given = parser.parse_args(arguments)
    with spread_over(given.workers) as spread:
        results = run_checks(
            drafts(given.cases, given.seed),
            {name: METHODS[name] for name in given.only},
            given.keep,
            seed=given.seed,
            spread=spread,
            progress=lambda said: print(said, file=sys.stderr, flush=True),
        )
    sys.stdout.write("\n\n".join(f"## {name}\n{table(result)}" for name, result in results.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
