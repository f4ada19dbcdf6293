"""The lag of processors as a condition: one alert for all of them, `processors_behind` on the plant.

It begins above `behind_s` and is over below `caught_up_s`; in between it stays what it is. A report is believed for a while: a
processor that has caught up, or has ended, says no more.
"""

from collections.abc import Sequence
from dataclasses import replace

from processors.alerts.facts import TEXT_MAX, Facts
from processors.alerts.phases import Beat, Condition
from processors.alerts.state import AlertsState, HeardLag
from processors.lag_report import LagReport, by_process, parsed
from twin.vocabulary.topics import LAG

FRESH_S = 30.0
LAGS_MAX = 200
PLANT = "plant"


def heard(state: AlertsState, topic: str, text: str, at_s: float) -> AlertsState:
    """The state after a report. One that is older than what is known has come the long way round, and is no news."""
    processor = topic.removeprefix(LAG)
    try:
        report = parsed(text)
    except ValueError:
        return replace(state, malformed=state.malformed + 1)
    known = state.lags.get(processor)
    if known is not None and report.at_ms <= known.report.at_ms and _is_fresh(known, at_s):
        return state
    if known is None and len(state.lags) >= LAGS_MAX:
        return state
    return replace(state, lags=state.lags | {processor: HeardLag(at_s, report)})


def without_old(lags: dict[str, HeardLag], wall_s: float) -> dict[str, HeardLag]:
    """The reports that can still be believed."""
    return {name: one for name, one in lags.items() if _is_fresh(one, wall_s)}


def condition_of(state: AlertsState, beat: Beat, limit_s: float) -> tuple[Condition, Facts]:
    """Return the condition that a process is at least `limit_s` behind, and the facts of it."""
    reports = by_process(one.report for one in without_old(state.lags, beat.wall_s).values())
    late = [report for report in reports if report.lag_s >= limit_s]
    return Condition(bool(late), "", round(beat.wall_s * 1000)), facts_of(late, limit_s)


def facts_of(late: Sequence[LagReport], limit_s: float) -> Facts:
    """Return the figures of the process that is furthest behind, the first, and the processors of all that are.

    fed: the machines that it folds; busy: per cent of a core; remedy: core, runner or elsewhere, as `LagReport.sentence` has it
    """
    if not late:
        return {}
    worst = late[0]
    names = ", ".join(sorted({name for report in late for name in report.processors}))
    facts: Facts = {"value": worst.lag_s, "limit": limit_s, "unit": "s", "fed": worst.machines, "busy": worst.busy_pct}
    if worst.runners:
        facts |= {"runners": worst.runners, "partitions": worst.partitions, "waiting": worst.waiting}
    return facts | {"processors": names[:TEXT_MAX], "remedy": worst.remedy.value}


def _is_fresh(one: HeardLag, wall_s: float) -> bool:
    return abs(wall_s - one.heard_s) <= FRESH_S
