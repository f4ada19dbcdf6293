"""The folder's account of a machine, as one document: the command line shows it, and the loop publishes it with its own."""

from collections.abc import Sequence
from typing import Any

from cnctwin.machines.evidence import Card, why_not
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.step_log import Step, StepKind
from twin.errors import MachineError

STEPS_TOLD = 50
_LIVE = frozenset({StepKind.DESCRIBED, StepKind.PROMOTED, StepKind.BACK})


def told(of: MachineFolder) -> dict[str, Any]:
    """Return the live description, the challenger, whether it may be promoted, and the last steps; times are ms since 1970."""
    steps, live, waits = of.steps(), of.live_version(), of.challenger_version()
    card = of.card(waits)
    reason = why_not(waits, live, card, of.shadow()) if waits else "no challenger waits"
    shadow = of.shadow()
    return {
        "machine": of.machine,
        "live": live_of(of, live, steps),
        "challenger": challenger_of(waits, card, steps) if waits else None,
        "score": None if card is None or card.score is None else card.score.model_dump(include={"live", "challenger", "runs"}),
        "shadow": shadow.model_dump(mode="json") if shadow is not None and shadow.version == waits else None,
        "may_promote": reason is None,
        "why_not": reason,
        "faults": faults_of(of),
        "steps": [step.document for step in steps[-STEPS_TOLD:]],
    }


def live_of(of: MachineFolder, version: str, steps: Sequence[Step]) -> dict[str, Any] | None:
    """Return which description is live, since when, by whom and why, and what of it is assumed; None where there is none."""
    if not version:
        return None
    step = _last(steps, version, _LIVE)
    since = of.live_file.stat().st_mtime * 1000 if step is None else step.t
    try:
        live = of.live()
        assumed = [] if live is None else list(live.assumed)
    except MachineError:
        assumed = []
    by, why = ("file", "") if step is None else (step.by, step.why)
    return {"version": version, "since": round(since), "by": by, "why": why, "assumed": assumed}


def challenger_of(version: str, card: Card | None, steps: Sequence[Step]) -> dict[str, Any]:
    """Return which description waits, and the diagnosis that it comes from."""
    step = _last(steps, version, frozenset({StepKind.FILED}))
    known = card or Card()
    return {
        "version": version,
        "since": None if step is None else step.t,
        "by": "file" if step is None else step.by,
        "sentence": known.sentence or ("" if step is None else step.why),
        "verdict": known.verdict,
        "causes": list(known.causes),
        "gap_before": known.gap_before,
        "gap_after": known.gap_after,
    }


def faults_of(of: MachineFolder) -> list[str]:
    """Return what is wrong with the files, a line each; processors go on with what they had."""
    found = []
    for read in (of.live, of.challenger):
        try:
            read()
        except MachineError as error:
            found.append(str(error))
    return found


def _last(steps: Sequence[Step], version: str, kinds: frozenset[StepKind]) -> Step | None:
    return next((step for step in reversed(steps) if step.version == version and step.step in kinds), None)
