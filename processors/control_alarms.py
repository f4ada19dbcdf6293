"""Alarms of the control itself, as an alarm of ours: one that counts is active, and nobody has acknowledged it at the control.

Which of `alarms` count is configured: numbers from `severity_min` on (OPC UA Part 9: 1 to 1,000), words that are not among
`minor_words`, and, where asked for, alarms without a severity; `ignored` names codes and texts that never do. One that counts is
high from `severity_high_min` on, or by a word among `high_words`; else medium.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from pydantic import Field

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample
from processors.sample import why_unknown
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

ALARMS, LINE = "alarms", "nc_line"
ALARM, TEXT, FINDINGS = twin_signals.CONTROL_ALARM, twin_signals.CONTROL_ALARM_TEXT, twin_signals.CONTROL_ALARM_FINDINGS
HIGH, MEDIUM = "high", "medium"
NONE, SHOWN_MAX, LENGTH_MAX = "none", 3, 300
NO_TEXT = "an alarm without a text"


class Config(ProcessorConfig):
    """The alarms of a control that count. ignored: patterns of codes or texts, as `EX10*`; case does not matter."""

    severity_min: int = Field(default=800, ge=1, le=1000)
    severity_high_min: int = Field(default=900, ge=1, le=1000)
    high_words: tuple[str, ...] = ("fault",)
    minor_words: tuple[str, ...] = ("warning", "information", "info", "note", "message")
    unknown_severity_counts: bool = False
    ignored: tuple[str, ...] = Field(default=(), max_length=1000)


@dataclass(frozen=True, slots=True)
class State:
    """An alarm that counts stands or does not; line: the NC line at which it came up, None where that is not known."""

    stands: bool = False
    line: int | None = None


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Judge the list of alarms as it stands."""
    reading = sample.row.get(ALARMS)
    if reading is None:
        return state, _null(f"{ALARMS} is not offered")
    why_not = why_unknown(reading)
    if why_not is not None:
        return state, _null(why_not)
    listed = _listed(reading.value)
    if listed is None:
        return state, _null(f"{ALARMS} is no JSON list of alarms")
    counting = [alarm for alarm in listed if counts(config, alarm)]
    if bool(counting) is not state.stands:
        state = State(True, _line(sample)) if counting else State()
    texts = [_text(alarm) for alarm in counting[:SHOWN_MAX]]
    if len(counting) > SHOWN_MAX:
        texts[-1] += f" (+{len(counting) - SHOWN_MAX})"
    found: dict[str, Any] = {}
    if counting:
        found["severity"] = HIGH if any(_is_high(config, alarm.get("severity")) for alarm in counting) else MEDIUM
    if state.line is not None:
        found["line"] = state.line
    return state, (
        Output(ALARM, bool(counting)),
        Output(TEXT, "; ".join(texts)[:LENGTH_MAX] or NONE),
        Output(FINDINGS, json.dumps(found, separators=(",", ":"))),
    )


def counts(config: Config, alarm: Mapping[str, Any]) -> bool:
    """Return True if an alarm is active, not acknowledged, severe enough, and not ignored.

    >>> config = Config(ignored=("EX10*",))
    >>> [counts(config, {"code": code, "severity": how}) for code, how in (("414", "fault"), ("EX1003", "fault"), ("7", 499))]
    [True, False, False]
    """
    if alarm.get("active") is False or alarm.get("acknowledged") is True:
        return False
    said = [str(alarm[name]).lower() for name in ("code", "text") if alarm.get(name) is not None]
    if any(fnmatchcase(one, pattern.lower()) for one in said for pattern in config.ignored):
        return False
    severity = alarm.get("severity")
    if isinstance(severity, (int, float)) and not isinstance(severity, bool):
        return severity >= config.severity_min
    if isinstance(severity, str) and severity:
        return severity.lower() not in config.minor_words
    return config.unknown_severity_counts


def _is_high(config: Config, severity: object) -> bool:
    if isinstance(severity, (int, float)) and not isinstance(severity, bool):
        return severity >= config.severity_high_min
    return isinstance(severity, str) and severity.lower() in config.high_words


def _line(sample: Sample) -> int | None:
    reading = sample.row.get(LINE)
    value = None if reading is None or reading.quality is not Quality.GOOD else reading.value
    return value if type(value) is int else None


def _listed(value: object) -> list[Mapping[str, Any]] | None:
    try:
        found = json.loads(value) if isinstance(value, str) else None
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, list):
        return None
    return [one for one in found if isinstance(one, dict)]


def _text(alarm: Mapping[str, Any]) -> str:
    said = (alarm.get("code"), alarm.get("text"))
    return " ".join(" ".join(str(one).split()) for one in said if one is not None)[:LENGTH_MAX] or NO_TEXT


def _null(reason: str) -> tuple[Output, ...]:
    return tuple(Output.null(name, reason) for name in (ALARM, TEXT, FINDINGS))


_INFERRED = Provenance.INFERRED
PROCESSOR = Processor(
    name="control_alarms",
    version=2,
    inputs=frozenset({ALARMS, LINE}),
    outputs=(
        OutputSpec(
            ALARM, DataType.BOOLEAN, None, "an alarm of the control that counts is not acknowledged", _INFERRED, is_alarm=True
        ),
        OutputSpec(TEXT, DataType.STRING, None, "which: code and text, the first three; none", _INFERRED),
        OutputSpec(
            FINDINGS, DataType.STRING, None, "JSON while it alarms: severity, and the NC line at which it came up", _INFERRED
        ),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
