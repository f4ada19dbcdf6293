"""One night: everything that can be judged of a stretch, together."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from cnctwin.validation.budgets import Budgets
from cnctwin.validation.cycle_time import Cycles, judged_cycle_time
from cnctwin.validation.evidence import Evidence
from cnctwin.validation.figure import Figure, Verdict, rounded, together
from cnctwin.validation.following_error import judged_following_error
from cnctwin.validation.force import judged_force
from cnctwin.validation.model import Twin
from cnctwin.validation.temperature import judged_temperature
from cnctwin.validation.vibration import judged_vibration

QUANTITIES = ("temperature", "force", "vibration", "following_error", "cycle_time")
MODELS = ("thermal", "cutting_force", "vibration", "residual")
"""Tables of the configuration that make the twin what it is."""
DIGITS = 12


def figures_of(twin: Twin, evidence: Evidence, cycles: Cycles, budgets: Budgets) -> list[Figure]:
    """All figures of a stretch."""
    return [
        *judged_temperature(twin, evidence, budgets),
        *judged_force(twin, evidence, budgets),
        *judged_vibration(evidence, budgets),
        *judged_following_error(twin, evidence, budgets),
        *judged_cycle_time(twin, cycles, budgets),
    ]


def worst(found: Sequence[Sequence[Figure]]) -> list[Figure]:
    """Return one figure each of several runs: of those judged the one nearest to or furthest over its budget, else the first."""
    best: dict[str, Figure] = {}
    for figure in (one for figures in found for one in figures):
        known = best.get(figure.key)
        if known is None or _rank(figure) < _rank(known):
            best[figure.key] = figure
    judged_of = {figure.quantity for figure in best.values() if figure.value is not None}
    return [f for f in best.values() if f.on or f.value is not None or f.quantity not in judged_of]


def _rank(figure: Figure) -> tuple[int, float]:
    """Over before within; then by share of the budget, of a correlation by its value."""
    value = 0.0 if figure.value is None else figure.value
    share = value / figure.budget if figure.measure == "r" else -value / figure.budget
    return list(Verdict).index(figure.verdict), share


def night_of(machine: str, figures: Sequence[Figure], evidence: Sequence[Evidence], twin: Twin, now_s: float) -> dict[str, Any]:
    """The night as it is kept."""
    first = evidence[0]
    is_dated = first.from_s > 1e9
    middle_s = (first.from_s + first.to_s) / 2.0 if is_dated else now_s
    clock = first.clock
    return {
        "night": datetime.fromtimestamp(middle_s, UTC).date().isoformat(),
        "machine": machine,
        "from": round(1000.0 * first.from_s) if is_dated else None,
        "to": round(1000.0 * first.to_s) if is_dated else None,
        "t": round(1000.0 * now_s),
        "source": "; ".join(one.source for one in evidence),
        "figures": [figure.as_json() for figure in figures],
        "clock": None
        if clock is None
        else {"offset_s": rounded(clock.offset_s) if not is_dated else round(clock.offset_s, 3), "r": rounded(clock.r),
              "rival": rounded(clock.rival), "by": clock.by},
        "verdict": str(together(figure.verdict for figure in figures)),
        "twin": twin_mark(twin),
    }  # fmt: skip


def twin_mark(twin: Twin) -> str:
    """Tells one twin from another: constants and configuration."""
    told = {
        "machine": None if twin.file is None else twin.file.model_dump(mode="json"),
        "tables": {name: twin.tables[name] for name in MODELS if name in twin.tables},
    }
    return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()[:DIGITS]


def by_quantity(figures: Sequence[Mapping[str, Any]]) -> dict[str, Verdict]:
    """One verdict for each quantity."""
    return {
        name: together(figure["verdict"] for figure in figures if figure["quantity"] == name)
        for name in QUANTITIES
        if any(figure["quantity"] == name for figure in figures)
    }
