"""Runs the blind check: draws questions, seals the answers, has cases diagnosed from folders alone, opens the seal, scores."""

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from cnctwin.blind_check.answer import Answer, answers_from_json, answers_json
from cnctwin.blind_check.case_folder import answer_of, write_case
from cnctwin.blind_check.given import Given, given_of
from cnctwin.blind_check.question import Question, draw
from cnctwin.blind_check.scoring import Judged, Scored, scored
from cnctwin.blind_check.sealed import opened, seal
from cnctwin.blind_check.unseen import closure_on_unseen
from twin.case import Case, read_case
from twin.errors import TwinError
from twin.gap.diagnosis import Diagnosed, Verdict
from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml

Diagnose = Callable[[Case], Diagnosed]
"""A function at the top of a module, so that a worker process finds it by name."""
BATCH = 8
"""Cases for each worker whose folders are there at a time."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The check. seal: of the answers, shown before anything was diagnosed; salt: opens it"""

    seed: int
    seal: str
    salt: str
    cases: tuple[Judged, ...]
    scored: Scored
    seconds: float


def run_check(
    count: int,
    seed: int,
    diagnose: Diagnose,
    *,
    workers: int = 2,
    progress: Callable[[str], None] = lambda _: None,
    clock: Callable[[], float] = time.perf_counter,
) -> CheckResult:
    """Draws `count` questions, seals their answers, has them diagnosed, and scores what came.

    workers: processes; 0 = in this one. A diagnosis that raises is a case that failed: it named nothing. Folders of cases are
    removed.
    """
    return run_checks(count, seed, {"": diagnose}, workers=workers, progress=progress, clock=clock)[""]


def run_checks(
    count: int,
    seed: int,
    methods: Mapping[str, Diagnose],
    *,
    workers: int = 2,
    progress: Callable[[str], None] = lambda _: None,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, CheckResult]:
    """As `run_check`, by several methods on the same cases; name → result, `seconds` that of all of them."""
    begin = clock()
    questions = draw(count, seed)
    with _mapping(workers) as mapped:
        answers = []
        for answer in mapped(answer_of, questions):
            answers.append(answer)
            progress(f"drawing machines: {len(answers)} of {count}")
        sealed = seal(answers_json(answers))
        progress(f"answers sealed as {sealed.seal.digest}")
        given: dict[str, list[Given]] = {name: [] for name in methods}
        batch = BATCH * max(workers, 1)
        for first in range(0, count, batch):
            chosen = slice(first, first + batch)
            for name, found in _batch(mapped, questions[chosen], answers[chosen], methods).items():
                given[name] += found
            progress(f"diagnosing: {min(first + batch, count)} of {count}")
    true = {answer.name: answer for answer in answers_from_json(opened(sealed.seal, sealed.salt, sealed.text))}
    results = {}
    for name, listed in given.items():
        cases = tuple(Judged(true[q.name], one) for q, one in zip(questions, listed, strict=True))
        results[name] = CheckResult(seed, sealed.seal.digest, sealed.salt, cases, scored(cases), clock() - begin)
    return results


Mapped = Callable[..., Iterator[Any]]
"""As `map`, in this process or in others."""


@contextmanager
def _mapping(workers: int) -> Iterator[Mapped]:
    """Maps in so many processes; in this one where there are none."""
    if workers < 1:
        yield map
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield pool.map


def _batch(
    mapped: Mapped, questions: Sequence[Question], answers: Sequence[Answer], methods: Mapping[str, Diagnose]
) -> dict[str, list[Given]]:
    """Writes some cases, has each method diagnose and judges it, and removes them."""
    root = Path(tempfile.mkdtemp(prefix="blind-check-"))
    try:
        folders = [root / question.name for question in questions]
        list(mapped(write_case, folders, questions, answers))
        results = {}
        for name, diagnose in methods.items():
            found = list(mapped(diagnosed, folders, [diagnose] * len(folders)))
            closures = mapped(_closure, questions, answers, [twin for _, twin in found])
            results[name] = [replace(given, closure_unseen=part) for (given, _), part in zip(found, closures, strict=True)]
        return results
    finally:
        shutil.rmtree(root, ignore_errors=True)


def diagnosed(folder: Path, diagnose: Diagnose) -> tuple[Given, str]:
    """Return the diagnosis of a folder and its twin as TOML; empty where it failed."""
    begin = time.perf_counter()
    try:
        found = diagnose(read_case(folder))
    except (TwinError, ArithmeticError, ValueError, LookupError, AssertionError) as error:
        said = f"{type(error).__name__}: {error}"
        return Given(Verdict.UNKNOWN, (), (), time.perf_counter() - begin, failed=said), ""
    return given_of(found.diagnosis, time.perf_counter() - begin), machine_to_toml(found.twin)


def _closure(question: Question, answer: Answer, twin: str) -> float | None:
    if not twin or not answer.effects:
        return None
    try:
        return closure_on_unseen(question, answer, machine_from_toml(twin))
    except TwinError:
        return None
