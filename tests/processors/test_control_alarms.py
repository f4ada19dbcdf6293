"""Which alarms of a control become ours: active, not acknowledged, severe enough, not ignored."""

import json
from typing import Any

import pytest

from processors.contract import Sample, SampleKind
from processors.control_alarms import ALARM, ALARMS, FINDINGS, LINE, TEXT, Config, State, step
from sparkplug.metric import Reading
from sparkplug.quality import Quality


def told(alarms: Any, config: Config | None = None, quality: Quality = Quality.GOOD) -> dict[str, Any]:
    text = alarms if isinstance(alarms, str) or alarms is None else json.dumps(alarms)
    reading = Reading(ALARMS, text, 1000, quality, None, "the edge is gone" if quality is not Quality.GOOD else None, False)
    _, outputs = step(config or Config(), State(), Sample("vmc", SampleKind.DATA, 1.0, {ALARMS: reading}, (ALARMS,)))
    return {one.name: one.value if one.reason is None else one.reason for one in outputs}


SERVO = {
    "code": "414",
    "text": "X AXIS DETECTION ERROR",
    "severity": "fault",
    "active": True,
    "acknowledged": None,
    "since": None,
}


@pytest.mark.parametrize(
    "alarm, counts",
    [
        (SERVO, True),
        (SERVO | {"acknowledged": True}, False),
        (SERVO | {"active": False}, False),
        (SERVO | {"severity": "Warning"}, False),
        (SERVO | {"severity": 800}, True),
        (SERVO | {"severity": 799}, False),
        (SERVO | {"severity": None}, False),
        (SERVO | {"severity": True}, False),
    ],
)
def test_an_alarm_counts_by_state_and_severity(alarm: dict[str, Any], counts: bool) -> None:
    found = told([alarm])
    assert (found[ALARM], found[TEXT]) == (counts, "414 X AXIS DETECTION ERROR" if counts else "none")


@pytest.mark.parametrize(
    "severity, found", [("Fault", "high"), ("error", "medium"), (900, "high"), (899, "medium"), ("warning", None)]
)
def test_one_that_counts_is_high_or_medium_by_its_own_severity(severity: Any, found: str | None) -> None:
    assert json.loads(told([SERVO | {"severity": severity}])[FINDINGS]) == ({"severity": found} if found else {})


def test_the_line_is_that_at_which_the_alarm_came_up() -> None:
    state, lines = State(), []
    for line, alarms in ((51, []), (52, [SERVO]), (53, [SERVO, SERVO]), (54, []), (None, [SERVO])):
        row = {ALARMS: Reading(ALARMS, json.dumps(alarms), 1000, Quality.GOOD, None, None, False)}
        quality = Quality.BAD if line is None else Quality.GOOD
        row[LINE] = Reading(LINE, line, 1000, quality, None, None, False)
        state, outputs = step(Config(), state, Sample("vmc", SampleKind.DATA, 1.0, row, (ALARMS, LINE)))
        findings = next(one.value for one in outputs if one.name == FINDINGS)
        lines.append(json.loads(str(findings)).get("line"))
    assert lines == [None, 52, 52, None, None]


def test_what_has_no_severity_counts_where_that_is_asked_for_and_what_is_ignored_never_does() -> None:
    config = Config(unknown_severity_counts=True, ignored=("ex1003", "*DOOR*"))
    alarms = [
        SERVO | {"severity": None, "code": code, "text": text}
        for code, text in (("EX1003", "x"), ("7", "Door open"), ("9", "OIL"))
    ]
    assert told(alarms, config) == {ALARM: True, TEXT: "9 OIL", FINDINGS: '{"severity":"medium"}'}


def test_three_are_named_and_the_rest_is_counted() -> None:
    found = told([SERVO | {"code": str(n), "text": "a"} for n in range(5)])
    assert found[TEXT] == "0 a; 1 a; 2 a (+2)"


@pytest.mark.parametrize("text", ["", "[", '{"code": 1}', "7", "[" * 100_000])
def test_a_text_that_is_no_list_is_a_null_with_the_reason(text: str) -> None:
    assert told(text) == dict.fromkeys((ALARM, TEXT, FINDINGS), "alarms is no JSON list of alarms")


def test_what_is_stale_is_not_judged() -> None:
    assert told([SERVO], quality=Quality.STALE)[ALARM] == "alarms is stale: the edge is gone"
    assert told(None, quality=Quality.BAD)[ALARM] == "alarms is bad: the edge is gone"


def test_entries_that_are_no_alarms_are_passed_over() -> None:
    assert told([1, None, "x", SERVO])[ALARM] is True
