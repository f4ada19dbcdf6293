"""Where: every cell is there, with its figure, its colour, and a mark where it stands."""

from dataclasses import replace

import pytest

from cnctwin.reports.gap.heat_map import STEPS, groups, step_of, where
from cnctwin.reports.gap.page import report_html
from tests.cnctwin.reports.gap.diagnosed import explained, partly, unknown, warming
from tests.cnctwin.reports.gap.page_reader import PageReader
from twin.gap.diagnosis import Cell


def cell(signal: str, regime: str, rms: float = 3.0) -> Cell:
    return Cell(signal, regime, 0.1, rms, rms, 0.01, True, "It is here.")


def test_every_cell_is_shown_before_and_after() -> None:
    given = explained().diagnosis
    page = PageReader("<!doctype html>\n" + where(given))
    shown = [c for c in page.of("td") if (c.get("class") or "").startswith("h")]
    assert len(shown) == len(given.where) + len(given.where_after)
    assert len(page.of("table", class_="heat")) == 2


@pytest.mark.parametrize("made", [unknown, warming, partly])
def test_only_cells_that_stand_are_marked(made: object) -> None:
    given = made().diagnosis  # type: ignore[operator]
    page = PageReader("<!doctype html>\n" + where(given))
    standing = sum(c.discovered for c in (*given.where, *given.where_after))
    assert len(page.of("td", class_="found")) == standing
    assert page.text.count(" stands") == standing + 1  # and once in the legend


def test_one_signal_in_two_regimes_is_a_map_of_two_cells() -> None:
    given = replace(
        warming().diagnosis, where=(cell("spindle_temp_c", "warm-up"), cell("spindle_temp_c", "cool-down")), where_after=()
    )
    page = PageReader("<!doctype html>\n" + where(given))
    assert "Spindle temperature" in page.text and "warm-up cool-down" in page.text


def test_signals_stand_with_those_that_have_their_regimes_in_the_order_of_the_machine() -> None:
    cells = [
        cell("z_torque_a", "rest"), cell("force_y_n", "cutting"), cell("x_pos_mm", "constant speed +"), cell("x_pos_mm", "rest"),
        cell("force_x_n", "tool change"), cell("force_x_n", "cutting"), cell("z_torque_a", "tool change"), cell("odd", "N10–N40"),
    ]  # fmt: skip
    assert groups(cells) == [
        (["x_pos_mm", "z_torque_a"], ["rest", "constant speed +", "tool change"]),
        (["force_x_n", "force_y_n"], ["cutting", "tool change"]),
        (["odd"], ["N10–N40"]),
    ]


def test_a_larger_gap_never_has_a_lighter_colour() -> None:
    steps = [step_of(0.1 * n) for n in range(1000)]
    assert steps == sorted(steps)
    assert set(steps) == set(range(len(STEPS) + 1))


def test_a_cell_that_the_machine_has_not_got_is_a_dash() -> None:
    given = replace(explained().diagnosis, where=(cell("x_pos_mm", "rest"), cell("y_pos_mm", "reversal")), where_after=())
    assert len(PageReader("<!doctype html>\n" + where(given)).of("td", class_="none")) == 2


def test_the_largest_discovery_is_said_first() -> None:
    given = explained()
    first, second = [c for c in given.diagnosis.where if c.discovered][:2]
    page = PageReader(report_html(given, "machine"))
    assert page.text.index("Where it is " + first.sentence + ".") < page.text.index(second.sentence + ".")
