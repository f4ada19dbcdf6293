"""The drift of the machine: the level that all tools and programs share, in blocks of hours, on the chart of growth.

    figure of a block = mean over its parts of the material of the batch that runs (twin/wear/joint.py)

Batches come and go, each with its own hardness; what stays when they go is the machine: its meter, its spindle, its bearings.
The chart is that of the gap (processors/gap/growth.py), with the correlation that batches give neighbouring blocks. The first
blocks are taken to be healthy. Blocks count only while two tools or more of a part are known sharp, since material and wear are
not told apart before.
"""

import json
import shlex
from datetime import UTC, datetime
from math import exp
from typing import NamedTuple

from processors.gap.growth import Baseline, Chart, charted, is_enough, learned, rule_of
from processors.tool_wear.config import Config
from twin.wear.machine import ANCHORS_MIN, Wear

YEAR_S = 365.25 * 86_400.0
SIDES = 2


class Drift(NamedTuple):
    """The blocks so far. block: number since 1970 of the one that runs, with its parts and their sum; last: figure of the block
    before
    """

    block: int = -1
    parts: int = 0
    total: float = 0.0
    last: float | None = None
    baseline: Baseline = Baseline()
    chart: Chart = Chart()
    level: float = 0.0


def after_part(config: Config, drift: Drift, wear: Wear) -> Drift:
    """Return the drift after a part has been judged."""
    block = int(wear.at_s // (config.block_h * 3600.0))
    if block != drift.block:
        drift = _closed(config, drift)._replace(block=block, parts=0, total=0.0)
    if wear.anchors < ANCHORS_MIN:
        return drift
    return drift._replace(parts=drift.parts + 1, total=drift.total + wear.material)


def _closed(config: Config, drift: Drift) -> Drift:
    if drift.parts < config.block_parts_min:
        return drift
    figure = drift.total / drift.parts
    if drift.baseline.blocks < config.healthy_blocks:
        return drift._replace(baseline=learned(drift.baseline, figure, drift.last), last=figure)
    between = SIDES * YEAR_S / (config.block_h * 3600.0) / config.false_alarms_per_year
    rule = rule_of(drift.baseline, config.drift_pct / 100.0, between)
    if rule is None:
        return drift._replace(last=figure)
    chart = charted(drift.chart, rule, drift.baseline, figure, drift.block * config.block_h * 3600.0)
    level = drift.level + (figure - drift.baseline.mean - drift.level) / 10.0
    return drift._replace(chart=chart, last=figure, level=level)


def is_drifting(config: Config, drift: Drift) -> tuple[bool | None, str]:
    """Return whether the machine drifts; None with the reason while that can't be judged."""
    if drift.baseline.blocks < config.healthy_blocks:
        return None, f"the first {config.healthy_blocks} blocks of {config.block_h:g} h with sharp tools are being learned"
    if not is_enough(drift.baseline):
        return None, "the first blocks are too much alike to judge growth: make healthy_blocks more"
    return drift.chart.grows != 0, ""


def in_words(config: Config, drift: Drift, machine: str) -> str:
    """Return what the drift rests on, and what to do about it."""
    healthy = f"the first {config.healthy_blocks} blocks of {config.block_h:g} h"
    if drift.chart.grows == 0:
        return f"what all tools and programs share is as it was in {healthy}, which are assumed healthy"
    way = "risen" if drift.chart.grows > 0 else "fallen"
    since = datetime.fromtimestamp(drift.chart.since_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    lately = f"{_lately_pct(drift):+.1f} %"
    return (
        f"the load of all tools and programs has {way} since {since} against {healthy}, by {lately} lately, so it is not "
        f"one tool and not one batch; to name the cause: cnctwin gap case --store STORE --machine {shlex.quote(machine)} "
        "--out CASE && cnctwin gap diagnose CASE --out diagnosis; with cnctwin twin run it begins by itself"
    )


def in_values(drift: Drift) -> str:
    """Return the drift as JSON: since when (ms), and by how many per cent lately; an empty object while there is none."""
    if drift.chart.grows == 0:
        return "{}"
    return json.dumps({"since": round(1000 * drift.chart.since_s), "pct": round(_lately_pct(drift), 1)})


def _lately_pct(drift: Drift) -> float:
    return 100.0 * (exp(drift.level) - 1.0)
