"""A report of lag: one sentence for people, one report for each process, and nothing that cannot be read is one."""

from dataclasses import replace

import pytest

from processors.lag_report import TEXT_MAX, LagReport, by_process, parsed

REPORT = LagReport(("thermal",), "hall-3:4711", 1_795_000_000_000, 18.2, 20, 104.8)


def test_a_report_comes_back_as_it_was_sent() -> None:
    assert parsed(REPORT.payload().decode()) == REPORT


@pytest.mark.parametrize(
    "text",
    ["", "nan", "[]", "{}", "[" * 100_000, " " * (TEXT_MAX + 1), REPORT.payload().decode().replace("18.2", "1e400")]
    + [replace(REPORT, **wrong).payload().decode() for wrong in ({"lag_s": -1.0}, {"process": ""}, {"machines": -1})],
)
def test_what_is_no_report_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        parsed(text)


def test_processors_of_one_process_are_one_report_and_the_worst_comes_first() -> None:
    others = [replace(REPORT, processors=(name,), lag_s=3.0) for name in ("mirror", "alerts")]
    alone = replace(REPORT, processors=("historian",), process="hall-3:4712", lag_s=30.0)
    first, second = by_process([*others, REPORT, alone])
    assert first == alone
    assert second == replace(REPORT, processors=("alerts", "mirror", "thermal"))
    assert by_process([]) == []


def test_a_process_that_is_behind_without_being_busy_is_sent_elsewhere() -> None:
    assert "cnctwin plan fleet" in REPORT.sentence
    assert "plan fleet" not in replace(REPORT, busy_pct=30.0).sentence
