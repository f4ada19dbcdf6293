"""Parts one after another as a machine tells them, judged as on the stream; it stands before the first and after each.

A model is taught by parts of other programs: what repeats from part to part, and tails. It keeps no course of any program, so a
program is judged from its second part, or against the twin in its first.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.recorded.expectations import expected_rows
from benchmarks.recorded.parts import TICK_S, Floats, Part
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.parts.alarms.why import Why
from twin.anomaly.parts.levels import BATCH_VAR, Level
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.replay import Recorded, fit, replayed

STAND_TICKS = 60


class Span(NamedTuple):
    """The ticks of a part in a recording, `end` not among them."""

    part: Part
    begin: int
    end: int


class Alert(NamedTuple):
    """An alarm that came on: in which part, how many seconds after its beginning."""

    part: Part
    at_s: float
    why: Why


class Judgement(NamedTuple):
    """spans, scores: (T,), alerts"""

    spans: Sequence[Span]
    scores: Floats
    is_idle: Floats
    alerts: Sequence[Alert]

    def first_alert(self, span: Span) -> Alert | None:
        """Return the first alert of a part."""
        return next((one for one in self.alerts if one.part is span.part), None)

    def largest(self, span: Span) -> float:
        """Return the largest score of a part, NaN where it was not judged."""
        own = slice(span.begin, span.end)
        known = self.scores[own][~self.is_idle[own].astype(bool)]
        return float(np.nanmax(known)) if np.isfinite(known).any() else float("nan")

    def judged_s(self, span: Span) -> float:
        """Return for how long a part was judged."""
        own = slice(span.begin, span.end)
        return TICK_S * float((np.isfinite(self.scores[own]) & ~self.is_idle[own].astype(bool)).sum())


def recorded(parts: Sequence[Part], folder: Path | None) -> tuple[Recorded, list[Span]]:
    """Return parts as one recording of one machine; folder: of the NC programs, None = without the twin."""
    labels = tuple(dict.fromkeys(part.label for part in parts))
    spans, at = [], STAND_TICKS
    for part in parts:
        spans.append(Span(part, at, at + part.ticks))
        at += part.ticks + STAND_TICKS
    ticks, signals = max(at - STAND_TICKS, 0), parts[0].signals
    values, expected = np.full((ticks, len(signals)), np.nan), np.full((ticks, 6), np.nan)
    program, tool, line = (np.full(ticks, -1, dtype=np.int64) for _ in range(3))
    feed, speed = np.full(ticks, np.nan), np.full(ticks, np.nan)
    gated = np.zeros(ticks, dtype=np.bool_)
    values[:STAND_TICKS] = 0.0
    for part, begin, end in spans:
        stands = slice(end, min(end + STAND_TICKS, ticks))  # no program is active
        values[stands], tool[stands], line[stands] = 0.0, part.tool[-1], part.line[-1]
        own = slice(begin, end)
        values[own], tool[own], line[own], gated[own] = part.values, part.tool, part.line, part.gated
        feed[own], speed[own] = part.feed_override_pct, part.spindle_override_pct
        program[own] = labels.index(part.label)
        if folder is not None:
            expected[own] = expected_rows(folder, part)
    return Recorded(parts[0].machine, TICK_S, signals, values, labels, program, tool, line, feed, speed, gated, expected), spans


def taught(parts: Sequence[Part], folder: Path | None) -> PartsModel:
    """Return what parts teach of spreads, tails and the twin's error, and nothing of a program, a tool or a material."""
    one, _ = recorded(parts, folder)
    model = fit([one])[0]
    return model.model_copy(update={"usual": {}, "tools": {}, "material": Level((), BATCH_VAR)})


def judgement(model: PartsModel, parts: Sequence[Part], rule: AlarmRule | None, folder: Path | None) -> Judgement:
    """Return how parts are judged one after another, each by those before it."""
    one, spans = recorded(parts, folder)
    found = replayed([model], [one], [rule])
    alerts = []
    for tick, _, why in found.whys:
        span = next(span for span in spans if span.begin <= tick < span.end)
        alerts.append(Alert(span.part, (tick - span.begin) * TICK_S, why))
    return Judgement(spans, found.scores[:, 0], found.is_idle[:, 0], alerts)
