"""The document that the loop retains on `cnctwin/loop/<machine>`: the folder, the standing gap, and what it is doing."""

from typing import Any

from cnctwin.loop.standing import Standing
from cnctwin.loop.state import State
from cnctwin.loop.wording import promotion
from cnctwin.loop.world import Work


def document_of(told: dict[str, Any], state: State, standing: Standing, work: Work) -> dict[str, Any]:
    """Return the document. told: what the folder tells (cnctwin/machines/told.py)."""
    signals = sorted({*standing.live, *standing.challenger})
    last = state.last
    return told | {
        "step": str(state.step),
        "since": state.since_ms,
        "text": f"{state.text}: {work.doing}" if work.doing else state.text,
        "progress": work.progress,
        "case": state.case or None,
        "job": state.case or None,
        "standing": {one: {"live": standing.live.get(one), "challenger": standing.challenger.get(one)} for one in signals},
        "open": standing.grows or standing.opens or None,
        "next_experiment": state.next_experiment,
        "last": None
        if last is None
        else {"text": promotion(last, is_since=False), **last.model_dump(include={"before", "after", "since"})},
        "answers": [answer.model_dump() for answer in state.answers],
    }
