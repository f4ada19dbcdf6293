"""The joint knowledge: a covariance stays one, and what a level cannot tell apart stays uncertain together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.wear.joint import MATERIAL, TOOLS_MAX, Joint, Observed, observed, passed, renewed, trend_of, with_tool
from twin.wear.trend import Trend, Wander

TREND = Trend(0.3, 0.01, 0.01, 1e-4, 1e-5)


def two_tools() -> Joint:
    return renewed(with_tool(with_tool(Joint(), "1", TREND), "2", TREND), MATERIAL, 0.0, 0.0025)


@given(st.lists(st.tuples(st.sampled_from("12"), st.floats(-0.5, 0.5), st.sampled_from([0.0, 0.3, 0.6])), max_size=30))
def test_a_covariance_stays_one(levels: list[tuple[str, float, float]]) -> None:
    joint = two_tools()
    for name, level, slope in levels:
        joint = passed(joint, 0.005, {name: Wander(1e-5, 1e-10)})
        joint, _ = observed(joint, Observed(name, level, 1e-4, 0.1, slope))
    rows = np.array(joint.rows)
    assert rows == pytest.approx(rows.T, abs=1e-9)
    assert np.linalg.eigvalsh(rows).min() > -1e-9


def test_a_level_of_a_worn_tool_leaves_material_and_wear_uncertain_together() -> None:
    joint, _ = observed(two_tools(), Observed("1", 0.15, 1e-6, 0.1, 0.3))
    place = joint.place("1")
    assert joint.rows[MATERIAL][place] < 0.0
    sharp, _ = observed(joint, Observed("2", 0.05, 1e-6, 0.0, 0.0))
    assert sharp.rows[MATERIAL][MATERIAL] < 0.1 * joint.rows[MATERIAL][MATERIAL]
    assert trend_of(sharp, "1").share == pytest.approx(trend_of(joint, "1").share, abs=0.2)


def test_tools_are_bounded() -> None:
    joint = Joint()
    for number in range(2 * TOOLS_MAX):
        joint = with_tool(joint, str(number), TREND)
    assert len(joint.names) == TOOLS_MAX
    assert len(joint.means) == len(joint.rows) == 2 + 2 * TOOLS_MAX
