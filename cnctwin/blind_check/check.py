"""Runs the blind check: draws questions, seals the answers, has cases diagnosed from folders alone, opens the seal, scores.

Each case is kept as soon as it is done, so a check that was stopped goes on where it stopped, and what is done can be published.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cnctwin.blind_check.kept import Kept, begun
from cnctwin.blind_check.piece import drawn, judged
from cnctwin.blind_check.question import Draft
from cnctwin.blind_check.scoring import Judged, Scored, scored
from cnctwin.jobs.spread import Spread

Methods = Mapping[str, str]
"""Name → `module:function`, by which any process finds it: a function of a case that returns what was diagnosed."""
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The check as far as it is done.

    seal: of the answers, shown before anything was diagnosed; salt: opens it; asked: cases that were to be drawn; redrawn: those
    whose first question could not be; undrawn: those of which none could be; programs: states of the twin that diagnosed
    """

    seed: int
    seal: str
    salt: str
    asked: int
    redrawn: tuple[str, ...]
    undrawn: tuple[str, ...]
    programs: frozenset[str]
    cases: tuple[Judged, ...]
    scored: Scored
    seconds: float


def run_checks(
    drafts: Sequence[Draft],
    methods: Methods,
    folder: Path,
    *,
    seed: int = 0,
    spread: Spread = map,
    progress: Progress = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, CheckResult]:
    """Draw the questions of `drafts`, seal their answers, have each method diagnose them, and score what came.

    folder: of the check, which is made, or gone on with; spread: where pieces are computed
    stopped: asked between cases; what is done until then is scored

    Name of a method → its result. A question that cannot be drawn ends no other; a diagnosis that raises is a case that failed.
    """
    begin = clock()
    kept = begun(folder, seed, drafts)
    _draw(kept, spread, progress, stopped)
    if kept.seal:
        progress(f"answers sealed as {kept.seal}")
        _diagnose(kept, methods, spread, progress, stopped)
    return {name: result_of(kept, name, clock() - begin) for name in methods}


def result_of(kept: Kept, method: str, seconds: float = 0.0) -> CheckResult:
    """Return what a method has given until now, scored."""
    cases, programs = kept.judged(method)
    redrawn = tuple(f"{name}: {found['said'][0]}" for name, found in kept.drawn.items() if found["said"])
    undrawn = tuple(name for name, found in kept.drawn.items() if found["redraws"] is None)
    return CheckResult(
        kept.seed, kept.seal, kept.salt, len(kept.drafts), redrawn, undrawn, programs, cases, scored(cases), seconds
    )


def _draw(kept: Kept, spread: Spread, progress: Progress, stopped: Callable[[], bool]) -> None:
    left = [(name, draft) for name, draft in zip(kept.names, kept.drafts, strict=True) if name not in kept.drawn]
    texts = [json.dumps({"draft": draft, "salt": kept.salt}) for _, draft in left]
    if stopped():
        return
    for (name, _), found in zip(left, spread(drawn, texts), strict=False):
        kept.keep_drawn(name, json.loads(found))
        progress(f"drawing machines: {len(kept.drawn)} of {len(kept.drafts)}")
        if stopped():
            return


def _diagnose(kept: Kept, methods: Methods, spread: Spread, progress: Progress, stopped: Callable[[], bool]) -> None:
    left = list(kept.missing(tuple(methods)))
    drafts = dict(zip(kept.names, kept.drafts, strict=True))
    texts = [
        json.dumps(
            {
                "draft": drafts[name],
                "salt": kept.salt,
                "redraws": kept.drawn[name]["redraws"],
                "digest": kept.drawn[name]["digest"],
                "methods": {method: methods[method] for method in missing},
            }
        )
        for name, missing in left
    ]
    count = len(kept.asked)
    progress(f"diagnosing: {count - len(left)} of {count}")
    if stopped():
        return
    for done, ((name, _), text) in enumerate(zip(left, spread(judged, texts), strict=False), start=1):
        found = json.loads(text)
        kept.keep_given(name, found["answer"], found["given"])
        progress(f"diagnosing: {count - len(left) + done} of {count}")
        if stopped():
            return
