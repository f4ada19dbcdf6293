"""Calibrates the thresholds of the gap diagnosis on healthy machines.

    .venv/bin/python benchmarks/gap/thresholds.py --healthy 16 --seed 501

On healthy machines of the reference plant: for each candidate the largest decrease of a signal's mean square (floors²), how many
sigmas it had, and whether `twin.gap.null` would have accepted it. `benchmarks/gap/leave_one_out.py` is the other side: machines
whose effect is not in the catalogue.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

from cnctwin.blind_check.case_folder import write_case
from cnctwin.blind_check.question import Question, Sort, draw
from twin.case import Case, read_case
from twin.gap.null import NULL
from twin.gap.search import Explained
from twin.gap.stages.plan import explained_stages, ground_of


def main() -> None:
    """Print the table."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--healthy", type=int, default=16)
    asked.add_argument("--seed", type=int, default=501)
    given = asked.parse_args()
    healthy(given.healthy, given.seed)


def healthy(count: int, seed: int) -> None:
    """Print what healthy machines show."""
    largest: dict[str, tuple[float, float]] = {}
    accepted, worst = 0, 0.0
    for _, case in _cases(draw(count, seed, Sort.HEALTHY)):
        for found in _stages(case):
            accepted += bool(found.best.effects)
            worst = max(worst, float(found.base.left.rms().max()) / found.stage.healthy_rms)
            for tried in found.tried:
                if tried.over is not None and tried.over.sigmas > 1.0:
                    name = tried.effected.effect
                    largest[name] = max(largest.get(name, (0.0, 0.0)), (tried.over.closes, tried.over.sigmas))
    print(
        f"{count} healthy machines: something accepted in {accepted} stages; worst signal {worst:.2f} of what is called healthy"
    )
    print(f"{'candidate':28s} closes (floors²; accepted above {NULL.closes_any:g})  sigmas (above {NULL.sigmas:g})")
    for name, (closes, sigmas) in sorted(largest.items(), key=lambda item: -item[1][0]):
        print(f"{name:28s} {closes:8.3f} {sigmas:30.1f}")


def _stages(case: Case) -> list[Explained]:
    return explained_stages(ground_of(case, frozenset()), lambda _: None)


def _cases(questions: tuple[Question, ...]) -> Iterator[tuple[Question, Case]]:
    for question in questions:
        with tempfile.TemporaryDirectory() as folder:
            write_case(Path(folder) / "case", question)
            yield question, read_case(Path(folder) / "case")


if __name__ == "__main__":
    main()
