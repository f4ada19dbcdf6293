"""Parts recorded under another program's label: how soon each is found, and that those under their own label are not."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.recorded.parts import TICK_S, Part
from benchmarks.recorded.replaying import Alert, judgement
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.parts.model import PartsModel

SETTLED_TICKS = 20
"""A tool that is in the spindle when a program begins may be that of the program before."""


class Trial(NamedTuple):
    """A part under a label, judged by what the label stands for. history: parts of that label made before

    is_right: the label is that of the text that ran
    """

    part: Part
    label: str
    is_right: bool
    history: Sequence[Part] = ()
    has_twin: bool = False


class Outcome(NamedTuple):
    """alert: the first one in the part, None = none; judged_s: for how long the part was judged
    most: the largest score in it, NaN = none
    stranger_s: when a tool came that no earlier part of the label has, so that nothing is known of it; None = never
    """

    trial: Trial
    alert: Alert | None
    judged_s: float
    most: float
    stranger_s: float | None


def outcome(model: PartsModel, trial: Trial, rule: AlarmRule, folder: Path) -> Outcome:
    """Return what the scores make of a trial."""
    parts = [*(part.labelled(trial.label) for part in trial.history), trial.part.labelled(trial.label)]
    found = judgement(model, parts, rule, folder if trial.has_twin else None)
    span = found.spans[-1]
    return Outcome(trial, found.first_alert(span), found.judged_s(span), found.largest(span), _stranger_s(trial))


def _stranger_s(trial: Trial) -> float | None:
    """Return the seconds until a tool is told that earlier parts of the label do not have, `SETTLED_TICKS` running."""
    known = {tool for part in trial.history for tool in part.tool.tolist()}
    if not known:
        return None
    tools, running = trial.part.tool.tolist(), 0
    for tick, tool in enumerate(tools):
        running = 0 if tool in known else running + 1
        if running == SETTLED_TICKS:
            return tick * TICK_S
    return None


def of_parts(by_name: Mapping[str, Part]) -> Iterator[Trial]:
    """Yield the trials against earlier parts: the wrong labels, each beside right ones."""
    for wrong, label, *history in (
        ("plate 13/1", "PLATE-1", "plate 01/1"),
        ("plate 14/1", "PLATE-13", "plate 13/1"),
        ("cover 02/4", "COVER OP1", "cover 01/1"),
        ("cover 02/1", "COVER OP2", "cover 01/2"),
        ("cover 03/1", "COVER OP1", "cover 01/1", "cover 02/1"),
        ("box 01/1", "BOX OP1", "box 03/1"),
        ("box 02/2", "BOX OP1", "box 03/1"),
        ("box 03/4", "BOX OP5", "box 02/6"),
        ("cover 02/1", "COVER OP1", "cover 01/1"),
        ("cover 02/4", "COVER OP2", "cover 01/2"),
        ("cover 03/2", "COVER OP2", "cover 01/2"),
        ("cover 04/4", "COVER OP2", "cover 03/2"),
        ("cover 02/5", "COVER OP3", "cover 01/3"),
        ("box 03/2", "BOX OP2", "box 01/2"),
        ("box 02/4", "BOX OP3", "box 01/3"),
        ("box 03/3", "BOX OP3", "box 01/3"),
        ("plate 13/2", "PLATE BACK FACE", "plate 03/2"),
    ):
        earlier = [by_name[name] for name in history]
        yield Trial(by_name[wrong], label, by_name[wrong].text == earlier[-1].text, earlier)


def of_the_twin(plates: Sequence[Part], labels: Sequence[str]) -> Iterator[Trial]:
    """Yield every plate under every label, in its first part: the twin of that label's program is all there is."""
    for plate in plates:
        for label in labels:
            yield Trial(plate, label, plate.label == label, has_twin=True)
