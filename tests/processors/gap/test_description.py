"""The gap beside a description: what the twin says comes from the file, and a new version begins again what it computes."""

from random import Random
from typing import Any

import pytest

from processors.description import Description
from processors.errors import ConfigurationError
from processors.gap.cell import Cell
from processors.gap.config import Config
from processors.gap.described import described
from processors.gap.figures import BASIS, GROWING, GROWING_SIGNAL, OPEN
from processors.gap.processor import PROCESSOR
from processors.gap.signals import GAP
from tests.processors.gap.weeks import DAY_S, HOUR_S, Weeks
from twin.errors import TwinError

LOAD, TEMPERATURE = f"{GAP}spindle_load_pct", f"{GAP}spindle_temp_c"
STATED = """
[machine]
name = "vmc"
{assumed}
[spindle]
rated_power_kw = 7.5
efficiency = 0.85
idle_power_kw = {idle_kw}
[program]
rapid_mm_min = 30000.0
acceleration_mm_s2 = 4000.0
tool_change_s = 3.2
[noise]
spindle_load_pct = 0.5
"""
GROWS_WITH_SPEED = '[[effects]]\neffect = "idle_speed_power"\nparameters = {{ power_kw = {kw}, exponent = 1.0 }}\n'
LONGER_CHANGE = '[[effects]]\neffect = "tool_change_time"\nparameters = { change_s = 1.5 }\n'


def description(idle_kw: float = 0.225, *effects: str, assumed: str = "") -> Description:
    """A description of this idle power: 0.225 kW are 3 % in air."""
    stated = f"assumed = [{assumed}]" if assumed else ""
    return Description.from_toml(STATED.format(idle_kw=idle_kw, assumed=stated) + "".join(effects))


def weeks(told: Description | None, **table: Any) -> Weeks:
    """A machine that takes 3.2 % in air, described so, without constants in processors.toml."""
    found = Weeks(**({"rated_power_kw": None, "idle_power_kw": None} | table))
    found.description = told
    return found


def cell(found: Weeks, key: str) -> Cell:
    return found.state.cells[key]


def test_the_load_in_air_is_that_of_the_description_at_the_speed_with_its_effects() -> None:
    twin = described(Config(), description(0.225, GROWS_WITH_SPEED.format(kw=0.15))).twin
    assert twin.idle_load_pct is not None
    assert twin.idle_load_pct(0.0) == pytest.approx(3.0)
    assert twin.idle_load_pct(5000.0) == pytest.approx(5.0)
    assert twin.idle_load_pct(10_000.0) == pytest.approx(7.0)


def test_the_tool_change_is_that_of_the_description_with_its_effects_and_unknown_where_nobody_states_it() -> None:
    assert described(Config(), description()).twin.tool_change_s == 3.2
    assert described(Config(), description(0.225, LONGER_CHANGE)).twin.tool_change_s == pytest.approx(4.7)
    bare = Description.from_toml('[machine]\nname = "vmc"')
    assert described(Config(), bare).twin.tool_change_s is None
    assert described(Config(), bare).twin.idle_load_pct is None


def test_constants_of_processors_toml_hold_for_a_machine_without_a_description_and_say_where_they_belong() -> None:
    old = Config(rated_power_kw=7.5, idle_power_kw=0.45)
    assert [line.split(";")[0] for line in old.belongs_elsewhere("gap")] == [
        "[gap] rated_power_kw belongs in machines/<name>.toml, [spindle]",
        "[gap] idle_power_kw belongs in machines/<name>.toml, [spindle]",
    ]
    without, own = described(old, None).twin, described(old, description()).twin
    assert without.idle_load_pct is not None
    assert own.idle_load_pct is not None
    assert (without.idle_load_pct(6000.0), own.idle_load_pct(6000.0)) == (pytest.approx(6.0), pytest.approx(3.0))


def test_a_description_with_an_effect_that_does_not_fit_is_refused() -> None:
    with pytest.raises(TwinError, match="no_such_effect"):
        described(Config(), description(0.225, '[[effects]]\neffect = "no_such_effect"\n'))


def test_a_new_version_begins_anew_what_it_computes_and_keeps_floors_and_what_was_learned() -> None:
    found = weeks(description()).run(15 * DAY_S)
    floor, axis = cell(found, "spindle_load_pct/air").deviation, cell(found, "axis_z_load_pct/standstill")
    assert found.shown[f"{LOAD}/mean"] == pytest.approx(-0.2, abs=0.4)
    found.description = description(0.45)  # 6 % in air
    found.run(2 * HOUR_S)
    air = cell(found, "spindle_load_pct/air")
    assert found.shown[f"{LOAD}/mean"] == pytest.approx(2.8, abs=0.6), "at once, not after the eight hours that figures forget in"
    assert air.deviation == pytest.approx(floor), "the floor is a property of machine and sensor"
    assert found.shown[LOAD] == pytest.approx(2.8 / floor, rel=0.25)
    assert cell(found, "axis_z_load_pct/standstill").level == axis.level
    assert cell(found, "axis_z_load_pct/standstill").standing.seconds == axis.standing.seconds
    assert f"description {description(0.45).version} since 2026-06-16T0" in found.shown[BASIS]


def test_a_twin_that_is_put_right_is_no_growth_and_a_gap_that_grows_afterwards_is_one() -> None:
    found = weeks(description()).run(14 * DAY_S)
    found.run(2 * DAY_S, lambda signal, _: 3.0 if signal == "spindle_load_pct" else 0.0)
    assert found.shown[GROWING] is True
    found.description = description(0.45)  # as the machine is now: 6.2 %
    found.run(4 * DAY_S, lambda signal, _: 3.0 if signal == "spindle_load_pct" else 0.0)
    assert found.shown[GROWING] is False
    assert found.shown[LOAD] < 1.3
    found.run(2 * DAY_S, lambda signal, _: 6.0 if signal == "spindle_load_pct" else 0.0)
    assert found.shown[GROWING_SIGNAL].startswith("spindle_load_pct in air: twin minus measured has fallen")


def test_a_version_that_says_the_same_changes_no_floor_and_is_judged_again_after_some_hours() -> None:
    found = weeks(description()).run(15 * DAY_S)
    assert cell(found, "spindle_load_pct/air").is_judged
    found.description = description(0.225, assumed='"spindle.efficiency"')
    found.run(HOUR_S)
    assert not cell(found, "spindle_load_pct/air").is_judged
    found.run(3 * DAY_S)
    assert cell(found, "spindle_load_pct/air").is_judged
    assert found.alarms == 0
    assert f"{LOAD.removeprefix(GAP)}: in air idle power by speed (assumed)" in found.shown[BASIS]


def test_the_challenger_starts_from_the_live_state_and_what_it_has_compared_goes_on_when_it_is_live() -> None:
    live = weeks(description()).run(15 * DAY_S)
    shadow = weeks(description(0.24)).run(0.0)
    assert PROCESSOR.beside is not None
    shadow.state, shadow.at_s, shadow.random = PROCESSOR.beside(live.state), live.at_s, Random(7)
    shadow.run(DAY_S)
    promoted = shadow.state
    shadow.run(HOUR_S)
    after = shadow.state
    assert after.version == promoted.version == description(0.24).version
    assert after.described_s == promoted.described_s
    assert after.cells["spindle_load_pct/air"].standing.seconds >= promoted.cells["spindle_load_pct/air"].standing.seconds
    assert after.cells["axis_z_load_pct/standstill"].is_judged


def test_until_a_floor_is_learned_it_is_the_noise_of_the_description_and_the_basis_says_so() -> None:
    found = weeks(description()).run(DAY_S)
    assert found.shown[LOAD] == pytest.approx(1.0, abs=0.5)
    assert "spindle_load_pct by the noise of the description until learned" in found.shown[BASIS]
    assert found.shown[TEMPERATURE] is None, "nobody states the noise of its sensor"
    found.run(14 * DAY_S)
    assert "until learned" not in found.shown[BASIS]
    assert found.shown[TEMPERATURE] is not None


def test_a_twin_that_was_wrong_from_its_first_day_stands_open_though_nothing_grew() -> None:
    wrong, right = weeks(description(0.45)), weeks(description(0.24))
    for found in (wrong, right):
        found.run(HOUR_S)
        assert found.shown[OPEN] == "none", "a gap has to stand for a while"
        found.run(DAY_S)
    assert right.shown[OPEN] == "none"
    assert wrong.shown[OPEN] == "spindle_load_pct in air: the twin is above what is measured since 2026-06-01T01:00:00Z"
    assert wrong.shown[GROWING] is None
    wrong.description = description(0.24)
    wrong.run(HOUR_S)
    assert wrong.shown[OPEN] == "none", "at once"


def test_once_a_baseline_is_there_only_a_gap_from_the_first_day_stands_open_and_growth_judges_the_rest() -> None:
    def later(signal: str, since_s: float) -> float:
        return 6.0 if signal == "spindle_load_pct" and since_s > 0.0 else 0.0

    wrong, right = weeks(description(0.45)), weeks(description(0.24))
    for found in (wrong, right):
        found.run(14 * DAY_S)
    assert wrong.shown[OPEN].startswith("spindle_load_pct in air: the twin is above what is measured since 2026-06-01")
    right.run(5 * DAY_S, later)
    assert right.shown[OPEN] == "none"
    assert right.shown[GROWING] is True


def test_what_a_challenger_publishes_is_the_gap_of_each_signal_its_mean_and_its_basis() -> None:
    own = {spec.name for spec in PROCESSOR.outputs if spec.of_challenger}
    assert {LOAD, f"{LOAD}/mean", TEMPERATURE, f"{TEMPERATURE}/mean", BASIS} <= own
    assert not own & {GROWING, OPEN, f"{LOAD}/air"}


def test_a_state_that_nothing_was_compared_in_takes_a_description_up_without_a_word() -> None:
    found = weeks(description()).run(600.0)
    assert found.state.described_s is None
    assert found.shown[BASIS].startswith(f"description {description().version}; temperature")


@pytest.mark.parametrize("table", [{"open_floors": 0.0}, {"open_s": 0.0}, {"publish_s": 0.0}])
def test_what_makes_no_sense_is_refused(table: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError):
        PROCESSOR.configured(table)
