"""Writes cases of the reference machine, for working with: `python -m cnctwin.blind_check.write OUT --cases 20 --seed 1`."""

import argparse
import sys
from pathlib import Path

from cnctwin.blind_check.answer import answers_json
from cnctwin.blind_check.case_folder import write_case
from cnctwin.blind_check.question import Sort, draw, names


def main(arguments: list[str] | None = None) -> int:
    """Write the cases and their answers; 2 where the folder is there already."""
    parser = argparse.ArgumentParser(description="Write cases of the reference machine, with their answers.")
    parser.add_argument("out", type=Path, help="folder to make")
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=[sort.value for sort in Sort], help="only of this sort")
    parser.add_argument("--effect", choices=[*names(named=True), *names(named=False)], help="only with this effect")
    given = parser.parse_args(arguments)
    if given.out.exists():
        sys.stderr.write(f"{given.out}: is there already; name a folder that is not\n")
        return 2
    sort = Sort(given.kind) if given.kind else None
    if given.effect and sort is None:
        sort = Sort.OUTSIDE if given.effect in names(named=False) else Sort.SINGLE
    answers = []
    for question in draw(given.cases, given.seed, sort, given.effect):
        answers.append(write_case(given.out / question.name, question))
        effects = ", ".join(f"{e.effect} on {e.on or 'the machine'} ({e.size:.1f})" for e in answers[-1].effects)
        sys.stdout.write(f"{question.name} {'+'.join(question.kinds)}: {effects or 'healthy'}\n")
        (given.out / "answers.json").write_text(answers_json(answers), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
