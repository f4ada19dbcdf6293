"""The verdict in a sentence, as an engineer would say it: what is certain, what remains and where, what was described."""

from collections.abc import Sequence

import numpy as np

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Cause, Cell, Diagnosis, Interval, Subsystem, Verdict
from twin.gap.naming.constants import said_of
from twin.gap.verdict import Judged
from twin.gap.wording import percent, regime_words, signal_words

SUBSYSTEMS_MAX, TERMS_MAX = 3, 2
"""Parts of the machine and learned terms that a sentence takes."""
FAR = 1.5
"""Floors from which on what is compared as a whole is off."""


def sentence_of(told: Diagnosis, stages: Sequence[Judged]) -> str:
    """Return the verdict of a diagnosis in words."""
    moved = said_of(told.constants)
    if told.verdict is Verdict.HEALTHY:
        leaves = f"{told.gap.before:.2g} × what repeated runs differ by"
        if moved:
            return f"Healthy, with {moved}: the twin is then {leaves}."
        return f"Healthy: with its constants refitted, the twin is {leaves}."
    if told.verdict is Verdict.EXPLAINED:
        return f"Explained: {_explained(told.causes, moved)}."
    return f"{'; '.join([_begun(told, stages), *_parts(told.subsystems), *_described(told)])}."


def _explained(causes: Sequence[Cause], moved: str) -> str:
    if not causes:
        return f"{moved or 'constants'}, which is further than its uncertainty allows; no effect of the catalogue does so better"
    return _causes(causes)


def _begun(told: Diagnosis, stages: Sequence[Judged]) -> str:
    """Return the causes, or that nothing is named, and the remainder."""
    unknown = [s for s in stages if s.verdict is Verdict.UNKNOWN]
    where = ", ".join(s.explained.stage.name for s in unknown)
    if told.causes:
        left = percent(max(0.0, 1.0 - told.gap.closure))
        place = _most(told.where_after) or (f"in {where}" if where else "")
        return (
            f"Partly explained: {_causes(told.causes)}; {left} remains{f', most of it {place}' if place else ', cause unknown'}"
        )
    looks = ", ".join(str(e) for s in stages for e in s.likeness)
    partly = f"; it partly looks like {looks}, which does not explain it" if looks else ""
    partly += "".join(
        f"; {s.explained.stage.name} comes to rest with another torque than the twin's" for s in unknown if s.explained.stops
    )
    # a part that is compared alone may be far off where all that is compared as a whole is not
    gap = told.gap.before if told.gap.before > FAR else max([told.gap.before, *(s.explained.base.left.gap() for s in unknown)])
    place = f"in {where}" if where else _most(told.where)
    size = f"{gap:.3g} × the repeatability{f' {place}' if place else ''}"
    return f"Unknown: a gap of {size} that no effect of the catalogue explains{partly}"


def _most(cells: Sequence[Cell]) -> str:
    """Return where most of what is left lies, in words; empty where nothing stands out."""
    found = [cell for cell in cells if cell.discovered]
    return f"in {signal_words(found[0].signal)} {regime_words(found[0].regime)}" if found else ""


def _parts(subsystems: Sequence[Subsystem]) -> list[str]:
    """Return the parts that are not healthy, worst first, and before them the controllers of the same axes that are."""
    wrong = [s for s in subsystems if s.verdict is not Verdict.HEALTHY][:SUBSYSTEMS_MAX]
    axes = {s.subsystem.partition(" ")[0] for s in wrong}
    told = [s for s in subsystems if s.verdict is Verdict.HEALTHY and s.subsystem in {f"{axis} controller" for axis in axes}]
    said = [f"{_part(s)} healthy" for s in told]
    for part in wrong:
        named = f", in {_joined(part.causes)}" if part.causes else ""
        said.append(f"{_part(part)} {part.before:.2g} × the repeatability{named}")
    return said


def _part(subsystem: Subsystem) -> str:
    axis, _, rest = subsystem.subsystem.partition(" ")
    return f"{axis.upper()} {rest}" if len(axis) == 1 and rest else subsystem.subsystem


def _joined(effects: Sequence[str]) -> str:
    return " and ".join(effect.replace("_", " ") for effect in effects)


def _described(told: Diagnosis) -> list[str]:
    return [f"described: {' and '.join(term.sentence for term in told.learned[:TERMS_MAX])}"] if told.learned else []


def _causes(causes: Sequence[Cause]) -> str:
    return "; ".join(f"{percent(c.closure)} {'' if i else 'of the gap comes '}from {_said(c)}" for i, c in enumerate(causes))


def _said(cause: Cause) -> str:
    parameters = effect_named(cause.effect).parameters
    sizes = [p for p in parameters if p.null is not None]
    there = [p for p in sizes if cause.parameters[p.name].value != p.null]
    told = max(there or sizes, key=lambda p: _clearness(cause.parameters[p.name], p.null))
    figure = figure_of(cause.parameters[told.name])
    size = figure if len(parameters) == 1 else f"{told.name} {figure}"
    rivals = ", ".join(_in_words(e.effect, e.on if e.on != cause.on else "") for e in cause.indistinguishable_from)
    return f"{_in_words(cause.effect, cause.on)} ({size}{f'; or {rivals}' if rivals else ''})"


def _clearness(interval: Interval, null: float | None) -> float:
    """Return the half-widths of its interval by which a figure is away from nothing."""
    if null is None or not np.isfinite(null):
        return np.inf
    return abs(interval.value - null) / max((interval.high - interval.low) / 2.0, 1e-12)


def _in_words(effect: str, on: str) -> str:
    """
    >>> _in_words("direction_friction", "x"), _in_words("sensor_bias", "z_torque_a"), _in_words("runout", "3")
    ('direction friction on X', 'sensor bias on z_torque_a', 'runout on tool 3')
    """
    where = f"tool {on}" if on.isdigit() else on.upper() if len(on) == 1 else on
    return f"{effect.replace('_', ' ')}{f' on {where}' if on else ''}"


def figure_of(interval: Interval) -> str:
    """A figure with the half of its interval, as sentences have it."""
    half = (interval.high - interval.low) / 2.0
    return f"{interval.value:.3g} ± {float(f'{half:.1g}'):g} {interval.unit}".strip()
