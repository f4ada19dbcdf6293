"""The twin's expectation of the line that runs, beside what is measured."""

import math
from pathlib import Path
from typing import Any

import pytest

from processors.config import Configuration
from processors.contract import Output, Sample, SampleKind
from processors.errors import ConfigurationError
from processors.expected.processor import PROCESSOR, Described, State, step
from sparkplug.metric import Reading
from tests.processors.describing import whole
from tests.processors.streams import reading
from tests.twin.expected.machines import PLATE, machine
from twin.expected.expectation import Expectation
from twin.expected.files import written
from twin.expected.making import expectation_of

LINE = PLATE.splitlines().index("G1 X60. F1200.")
LOAD, LEAST, MOST = "twin/expected_spindle_load_pct", "twin/expected_cut_least_pct", "twin/expected_cut_most_pct"
CUT, RESIDUAL, RATIO = "twin/spindle_cut_load_pct", "twin/spindle_load_residual_pct", "twin/expected_ratio"
NAMES = {spec.name for spec in PROCESSOR.outputs}


@pytest.fixture(name="made", scope="module")
def made_fixture() -> Expectation:
    return expectation_of(machine(), PLATE, name="O12", description="of then")


@pytest.fixture(name="given")
def given_fixture(made: Expectation, tmp_path: Path) -> Described:
    written(tmp_path, made)
    return Described(PROCESSOR.configured({"expectations": str(tmp_path)}))


class Machine:
    """A machine that tells of itself, sample by sample."""

    def __init__(self, given: Described) -> None:
        self.given, self.state, self.at_s = given, State(), 0.0
        self.row: dict[str, Reading] = {}

    def tells(self, since_s: float = 1.0, **values: Any) -> dict[str, Output]:
        self.at_s += since_s
        self.row |= {name: reading(name, value) for name, value in values.items()}
        self.state, outputs = step(self.given, self.state, Sample("small", SampleKind.DATA, self.at_s, self.row))
        return {one.name: one for one in outputs if isinstance(one, Output)}


def cuts(given: Described, made: Expectation, factor: float = 1.0, idle: float = 0.0) -> tuple[Machine, dict[str, Output]]:
    """A machine that goes through the line at 10 Hz, its cut off by a factor and its idle load by a sum, %."""
    told = Machine(given)
    air = made.at(LINE - 1)
    assert air is not None
    still = {"program": "/PRG/O0012.NC", "tool_number": 0, "spindle_rpm": 4000.0}
    for _ in range(30):
        shown = told.tells(0.1, **still, nc_line=4, feed_mm_min=0.0, spindle_load_pct=air.load_pct + idle)
    for tick in range(20):
        along = 2.0 * tick
        expected = made.at(LINE, 1200.0, 4000.0, along_mm=along)
        assert expected is not None
        load = expected.load_pct + (factor - 1.0) * expected.cut_load_pct + idle
        shown = told.tells(0.1, nc_line=LINE, feed_mm_min=1200.0, spindle_load_pct=load)
    return told, shown


def test_a_machine_that_is_as_the_twin_has_no_residual(given: Described, made: Expectation) -> None:
    _, shown = cuts(given, made)
    assert set(shown) == NAMES
    assert float(shown[RESIDUAL].value or 0.0) == pytest.approx(0.0, abs=0.01)  # type: ignore[arg-type]
    assert shown[LEAST].value == pytest.approx(shown[CUT].value, rel=0.02)
    assert shown["twin/expected_basis"].value == "; ".join(made.basis)


def test_what_the_spindle_takes_in_air_is_not_of_the_cut(given: Described, made: Expectation) -> None:
    _, shown = cuts(given, made, idle=3.0)
    assert shown[RESIDUAL].value == pytest.approx(3.0, abs=0.01)
    assert shown[CUT].value == pytest.approx(shown[LEAST].value, rel=0.02)


def test_another_feed_is_another_load_and_the_planned_feed_follows_the_override(given: Described, made: Expectation) -> None:
    told, before = cuts(given, made)
    half = told.tells(0.1, feed_mm_min=600.0, feed_override_pct=50.0)
    assert float(half[LOAD].value or 0.0) - 5.0 == pytest.approx(0.5 * (float(before[LOAD].value or 0.0) - 5.0), rel=0.02)  # type: ignore[arg-type]
    line = made.at(LINE)
    assert line is not None
    assert half["twin/expected_feed_mm_min"].value == pytest.approx(0.5 * line.feed_mm_min, abs=0.1)


def test_at_the_beginning_of_a_line_the_cut_may_be_none_yet(given: Described) -> None:
    told = Machine(given)
    values = {"program": "O12", "spindle_rpm": 4000.0, "spindle_load_pct": 5.0, "feed_mm_min": 1200.0}
    told.tells(**values, nc_line=LINE - 1)
    begun = told.tells(nc_line=LINE)
    assert begun[LEAST].value == 0.0
    assert float(begun[MOST].value or 0.0) > 5.0  # type: ignore[arg-type]


def test_the_ratio_of_a_tool_is_learned_slowly(given: Described, made: Expectation) -> None:
    told, shown = cuts(given, made, factor=1.2)
    assert shown[RATIO].reason == "too little of this tool has been seen"
    expected = made.at(LINE, 60.0, 4000.0, along_mm=40.0)
    assert expected is not None and math.isfinite(expected.load_pct)
    told.row["nc_line"] = reading("nc_line", LINE)
    for _ in range(250):
        place = told.state.place._replace(along_mm=40.0, planned_mm=40.0)
        told.state = State(place, *list(told.state.__getstate__())[1:])  # type: ignore[attr-defined]
        now = made.at(LINE, 1200.0, 4000.0, along_mm=40.0)
        assert now is not None
        shown = told.tells(0.1, spindle_load_pct=now.load_pct + 0.2 * now.cut_load_pct)
    assert shown[RATIO].value == pytest.approx(1.2, rel=0.02)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"program": "O13"}, "no expectation for program O13: cnctwin expect makes one"),
        ({"program": "O12"}, "nc_line is not offered"),
        ({}, "program is not offered"),
        ({"program": "O12", "nc_line": 999}, "program O12 has no move in this line"),
    ],
)
def test_what_is_not_known_is_null_with_the_reason(given: Described, values: dict[str, Any], why: str) -> None:
    shown = Machine(given).tells(**values)
    assert {one.reason for one in shown.values()} == {why}
    assert {one.value for one in shown.values()} == {None}


def test_a_changed_description_is_told_first_of_all(given: Described, made: Expectation) -> None:
    now = Described(given.configuration, whole().version)
    _, shown = cuts(now, made)
    assert str(shown["twin/expected_basis"].value).startswith("the description of small has changed since")


def test_without_a_folder_it_says_what_makes_one() -> None:
    shown = Machine(Described(Configuration(PROCESSOR.config, {}))).tells(program="O12", nc_line=LINE)
    assert {one.reason for one in shown.values()} == {
        "no expectations; cnctwin expect makes them, [expected] expectations names their folder"
    }


def test_a_folder_that_is_not_there_is_refused_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no such folder"):
        PROCESSOR.configured({"expectations": str(tmp_path / "none")})
