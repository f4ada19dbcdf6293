"""How far: the steps add up, and what is left of a healthy machine is nothing to close."""

import math
from dataclasses import replace

import pytest

from cnctwin.reports.gap.page import report_html
from cnctwin.reports.gap.waterfall import steps
from tests.cnctwin.reports.gap.diagnosed import explained, healthy, partly, unknown
from tests.cnctwin.reports.gap.page_reader import PageReader


def test_the_steps_lead_from_all_of_the_gap_to_what_has_no_name() -> None:
    before, first, second, rest = steps(partly().diagnosis)
    assert (before.low, before.high) == (0.0, 1.0)
    assert (first.name, second.name) == ("Direction friction on Z", "Presliding on Z")
    assert first.high == pytest.approx(1.0) and first.low == pytest.approx(second.high) == pytest.approx(0.36)
    assert rest.high == pytest.approx(second.low) == pytest.approx(0.19)


def test_what_is_left_after_a_step_is_the_rms_over_the_floor() -> None:
    first = list(steps(partly().diagnosis))[1]
    level = math.sqrt(1.0 + 0.36 * (14.7**2 - 1.0))
    assert first.left == f"leaves {level:.2f} ×"


def test_shares_beyond_all_or_below_none_stay_in_the_chart() -> None:
    given = partly().diagnosis
    odd = replace(given, causes=tuple(replace(c, closure=v) for c, v in zip(given.causes, (1.7, -0.2), strict=True)))
    for step in steps(odd):
        assert 0.0 <= step.low <= step.high <= 1.0


def test_a_gap_without_causes_has_no_name_at_all() -> None:
    *_, rest = steps(unknown().diagnosis)
    assert (rest.low, rest.high, rest.says) == (0.0, 1.0, "100 %")


def test_a_healthy_machine_has_no_waterfall() -> None:
    page = PageReader(report_html(healthy(), "machine"))
    assert not page.of("table", class_="waterfall")
    assert "no more than what repeated runs differ by" in page.text


def test_every_signal_has_its_row_in_the_unit_that_is_read() -> None:
    given = explained()
    page = PageReader(report_html(given, "machine"))
    gap = given.diagnosis.gap.by_signal["z_pos_mm"]
    assert f"Z position {1000 * gap.before:.3g} " in page.text
    assert len(page.of("circle", class_="before")) == len(given.diagnosis.gap.by_signal)
