"""The judgement of a diagnosis: whether the corrected description is worth filing, and what speaks for it.

It is scored beside the live one on the check runs of the case, which neither was fitted to.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.loop.world import Finding
from cnctwin.machines.evidence import Card, Score
from processors.description import version_of
from twin.case import Case, read_case
from twin.errors import CaseError
from twin.gap.diagnosis import Verdict
from twin.gap.score_of import score_of
from twin.gap.wording import effect_words, signal_words
from twin.machine import MachineFile, machine_from_toml

CHECK = "check"
BETTER_BY = 0.9
"""Without a cause by name: the part of the gap that may be left where constants alone have moved."""

_OF_A_CAUSE = ("effect", "on", "probability", "parameters", "indistinguishable_from")


def judged(case: Path, result: Path, live_toml: str, composed: Mapping[str, Any] | None = None) -> Finding:
    """Return what the diagnosis in the folder `result` has led to, for a live description. Raises UsageError, TwinError."""
    toml, diagnosis = _text(result / "twin.toml"), _diagnosis(result)
    recorded = read_case(case)
    score = _score(recorded, machine_from_toml(live_toml, "the live description"), machine_from_toml(toml, "twin.toml"))
    card = _card(diagnosis, None if score is None else score.model_copy(update={"against": version_of(live_toml)}), composed)
    experiment = diagnosis.get("next_experiment")
    reason = _why_not(diagnosis, score)
    sentence = str(diagnosis.get("sentence", ""))
    if reason is None:
        return Finding(True, sentence, toml, card, experiment)
    return Finding(False, f"{reason}. {sentence}{_next(experiment)}", toml, card, experiment)


def card_of(twin: Path, case: Path | None, live_toml: str | None) -> Card:
    """Return what speaks for a description that a person files: the diagnosis beside it, its score on the check runs of a case.

    Raises UsageError, TwinError.
    """
    diagnosis = _diagnosis(twin.parent) if (twin.parent / "diagnosis.json").is_file() else {}
    score = None
    if case is not None and live_toml is not None:
        machines = (machine_from_toml(live_toml, "the live description"), machine_from_toml(_text(twin), str(twin)))
        score = _score(read_case(case), *machines)
        if score is None:
            raise UsageError(f"{case}: no run of role check that both can be compared on; nothing can be scored")
    known = None if score is None else score.model_copy(update={"against": version_of(live_toml or "")})
    return _card(diagnosis, known, None).model_copy(update={"case": str(case or "")})


def _why_not(diagnosis: Mapping[str, Any], score: Score | None) -> str | None:
    """Return why the corrected description is not filed; None where it is."""
    verdict = diagnosis.get("verdict")
    if score is not None and score.challenger >= score.live:
        gaps = f"{score.challenger:.2f} × the repeatability against {score.live:.2f}"
        return f"the corrected description is no better on {score.runs} runs that it was not fitted to: {gaps}"
    if verdict in (Verdict.EXPLAINED, Verdict.PARTLY):
        return None
    has_moved = bool(diagnosis.get("constants") or diagnosis.get("learned"))
    if has_moved and score is not None and score.challenger <= BETTER_BY * score.live:
        return None
    if verdict == Verdict.HEALTHY:
        return "the diagnosis finds no gap beyond the repeatability"
    return "the diagnosis finds no cause"


def _score(case: Case, live: MachineFile, challenger: MachineFile) -> Score | None:
    runs = len(case.of(role=CHECK))
    if not runs:
        return None
    try:
        before, after = (score_of(machine, case, CHECK).gap for machine in (live, challenger))
    except CaseError:
        return None
    return Score(live=_digits(before), challenger=_digits(after), runs=runs)


def _card(diagnosis: Mapping[str, Any], score: Score | None, composed: Mapping[str, Any] | None) -> Card:
    gap, causes = diagnosis.get("gap") or {}, diagnosis.get("causes") or []
    by_signal = gap.get("by_signal") or {}
    signal = _largest(by_signal)
    fitted = [run for run in (composed or {}).get("runs", ()) if run.get("role") == "fit" and run.get("from_ms")]
    before, after = gap.get("before"), gap.get("after")
    says = _says(diagnosis)
    words = signal_words(signal) if signal else ""
    told = _closed(words, by_signal[signal]) if signal else ""
    return Card(
        sentence=f"{says}{told}" if says else str(diagnosis.get("sentence", "")),
        verdict=str(diagnosis.get("verdict", "")),
        causes=tuple({key: one.get(key) for key in _OF_A_CAUSE} for one in causes),
        says=says,
        signal=signal,
        words=words,
        gap_before=before,
        gap_after=after,
        score=score,
        fitted_from=min((run["from_ms"] for run in fitted), default=0),
        fitted_to=max((run["to_ms"] for run in fitted), default=0),
    )


def _says(diagnosis: Mapping[str, Any]) -> str:
    """Return the causes in plain words, with what each cannot be told from."""
    if causes := diagnosis.get("causes"):
        return " and ".join(_cause_words(one) for one in causes[:3])
    return "constants differ from what was stated" if diagnosis.get("constants") else ""


def _cause_words(cause: Mapping[str, Any]) -> str:
    others = [effect_words(other["effect"], other.get("on", "")) for other in cause.get("indistinguishable_from") or ()]
    return effect_words(cause["effect"], cause.get("on", "")) + (f" (or {', '.join(others)})" if others else "")


def _largest(by_signal: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the signal whose gap was largest, in floors."""

    return max(by_signal, key=lambda signal: _floors(by_signal[signal], "before"), default="")


def _closed(words: str, gap: Mapping[str, Any]) -> str:
    return f": gap of {words} {_floors(gap, 'before'):.1f} → {_floors(gap, 'after'):.1f} × the repeatability"


def _floors(gap: Mapping[str, Any], which: str) -> float:
    floor = float(gap.get("floor") or 0.0)
    return float(gap.get(which) or 0.0) / floor if floor > 0.0 else 0.0


def _next(experiment: Mapping[str, Any] | None) -> str:
    return f" Next experiment: {experiment['why']}" if experiment else ""


def _diagnosis(result: Path) -> dict[str, Any]:
    try:
        found = json.loads(_text(result / "diagnosis.json"))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{result / 'diagnosis.json'}: is no diagnosis: {error}") from None
    if not isinstance(found, dict):
        raise UsageError(f"{result / 'diagnosis.json'}: is no diagnosis")
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {error}; is --jobs the consumer's folder?") from None


def _digits(value: float) -> float:
    return float(f"{value:.6g}")
