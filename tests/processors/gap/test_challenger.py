"""The gap of a challenger beside the live one, through the engine: published beside it, and live at once when it is promoted."""

from typing import Any

import pytest

from processors.actions import Publish
from processors.description import Description, Role
from processors.gap.processor import PROCESSOR
from processors.gap.signals import GAP
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from tests.processors.streams import birth, data, engine_of, fed

LOAD, SHADOW = f"{GAP}spindle_load_pct", "twin/challenger/gap_spindle_load_pct"
TURNING = {"spindle_rpm": 6000.0, "spindle_load_pct": 5.0, "feed_mm_min": 0.0}


def description(idle_kw: float) -> Description:
    """A drive of 10 kW: 0.1 kW are 1 %."""
    stated = f"rated_power_kw = 10.0\nefficiency = 0.9\nidle_power_kw = {idle_kw}\n"
    return Description.from_toml(f'[machine]\nname = "okuma"\n[spindle]\n{stated}[noise]\nspindle_load_pct = 0.5\n')


def minutes(start: int, count: int) -> list[HostEvent]:
    return [data(60.0 * i, **TURNING) for i in range(start, start + count)]


def told(actions: list[Any]) -> dict[str, Any]:
    return {change.name: change.value for one in actions if isinstance(one, Publish) for change in one.changes}


def test_the_challengers_gap_stands_beside_the_live_one_and_closes_it_at_once_when_promoted() -> None:
    live, right = description(0.3), description(0.5)
    engine = engine_of(PROCESSOR)
    engine.describe("okuma", Role.LIVE, live)
    before = told(fed(engine, birth(0.0, **TURNING), *minutes(1, 10)))
    assert before[LOAD] == pytest.approx(4.0)
    engine.describe("okuma", Role.CHALLENGER, right)
    beside = told(fed(engine, *minutes(11, 10)))
    assert beside[SHADOW] == pytest.approx(0.0)
    assert beside["twin/challenger/gap_spindle_load_pct/mean"] == pytest.approx(0.0)
    assert beside["twin/challenger/gap_basis"].startswith(f"description {right.version} since ")
    engine.describe("okuma", Role.LIVE, right)
    engine.describe("okuma", Role.CHALLENGER, None)
    after = told(fed(engine, *minutes(21, 2)))
    assert after[LOAD] == pytest.approx(0.0), "nothing begins again"
    state = engine._machines["okuma"].live.state
    assert state.version == right.version
    assert state.cells["spindle_load_pct/air"].standing.seconds > 9 * 60.0


HEAT = "twin/spindle_temp_residual_k"
THERMAL = NodeId("cnc", "twin-thermal")


def heat(at_s: float, basis: Description, residual_k: float, prefix: str = "twin") -> HostEvent:
    """The word of processor thermal, for the live description or for the challenger."""
    named = {
        "spindle_temp_residual_k": residual_k,
        "spindle_temp_rise_k": 9.0,
        "spindle_temp_basis": f"description {basis.version}",
    }
    return data(at_s, node=THERMAL, **{f"{prefix}/{name}": value for name, value in named.items()})


def test_heat_of_another_description_is_not_compared_until_thermal_has_taken_this_one_up() -> None:
    live, right = description(0.3), description(0.5)
    engine = engine_of(PROCESSOR, floors={"spindle_temp_c": 0.5})
    engine.describe("okuma", Role.LIVE, live)
    fed(engine, birth(0.0, **TURNING), birth(0.1, node=THERMAL, **{HEAT: 0.0}), heat(1.0, live, -4.0), *minutes(1, 10))
    engine.describe("okuma", Role.CHALLENGER, right)
    early = told(fed(engine, *minutes(11, 10)))
    assert early["twin/challenger/gap_spindle_temp_c"] is None, "the live twin's heat is not the challenger's"
    beside = told(fed(engine, heat(1201.0, right, -0.1, "twin/challenger"), *minutes(21, 10)))
    assert beside["twin/challenger/gap_spindle_temp_c"] == pytest.approx(0.2)
    engine.describe("okuma", Role.LIVE, right)
    engine.describe("okuma", Role.CHALLENGER, None)
    after = told(fed(engine, *minutes(31, 10), heat(2401.0, right, -0.1), *minutes(41, 10)))
    assert after[f"{GAP}spindle_temp_c"] == pytest.approx(0.2), "what thermal has said for the one before does not count"
