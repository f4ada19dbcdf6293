"""Predictions: the physics for a planned course, within ranges that are checked."""

import json
import math
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest

from cnctwin.api.constants import Constants
from cnctwin.plant.descriptions import LiveDescriptions
from processors.description import DescriptionMessage
from processors.errors import ConfigurationError
from tests.cnctwin.api.small_plant import Client, client_of
from tests.processors.machines import CUTTER, described_as
from twin.machine_toml import machine_to_toml

PLAN: dict[str, Any] = {
    "start_temp_c": 20.0,
    "ambient_temp_c": [20.0] * 3,
    "spindle_load_pct": [50.0] * 3,
    "spindle_rpm": [6000.0] * 3,
    "dt_s": 60.0,
}


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with client_of() as client:
        yield client


def predict(client: Client, plan: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    answer = client.post("/predict", json=plan)
    return answer.status_code, answer.json()


def test_the_answer_is_the_exact_solution_of_the_network(client: Client) -> None:
    status, told = predict(client, PLAN)
    assert status == 200
    final_k = (1.8e-8 * 50.0 * 6000.0**2 + 1.2e-3 * 6000.0) * 0.18
    expected = [20.0 + final_k * (1.0 - math.exp(-60.0 * step / 2610.0)) for step in (1, 2, 3)]
    assert told["spindle_temp_c"] == pytest.approx(expected, abs=1e-4)
    # 50 % of 15 kW at an efficiency of 0.85 are 6.375 kW; a 12 mm tool at 6,000 rev/min cuts at 3.770 m/s
    assert told["cutting_force_n"] == pytest.approx([1691.0] * 3, abs=0.1)


def test_how_a_constant_stretch_is_cut_into_steps_changes_nothing(client: Client) -> None:
    names = ("ambient_temp_c", "spindle_load_pct", "spindle_rpm")
    one = predict(client, {**PLAN, "dt_s": 30.0, **{name: PLAN[name] * 2 for name in names}})[1]
    assert one["spindle_temp_c"][-1] == pytest.approx(predict(client, PLAN)[1]["spindle_temp_c"][-1], abs=1e-4)


def test_the_answer_says_whose_constants_it_used(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text(
        "[thermal]\nresistance_k_per_w = 0.12\n[thermal.machines.vmc]\nresistance_k_per_w = 0.10\n"
        "[cutting_force]\nrated_power_kw = 11.0\n"
    )
    with client_of(constants=Constants(file)) as client:
        vmc = predict(client, {**PLAN, "machine": "vmc"})[1]
        other = predict(client, {**PLAN, "machine": "other"})[1]
    assert vmc["constants"]["resistance_k_per_w"] == 0.10
    assert vmc["basis"]["thermal"] == "[thermal.machines.vmc] of the configuration"
    assert other["constants"]["resistance_k_per_w"] == 0.12
    assert other["basis"]["cutting_force"] == "[cutting_force] of the configuration, for all machines"


def test_constants_that_nobody_gave_are_said_to_be_defaults(client: Client) -> None:
    basis = predict(client, PLAN)[1]["basis"]
    assert basis["thermal"].startswith("defaults")
    assert basis["residual"] == "none: no folder of models was named"


def test_where_power_over_speed_means_nothing_the_force_is_null_and_says_why(client: Client) -> None:
    told = predict(client, {**PLAN, "spindle_rpm": [0.0, 10.0, 6000.0]})[1]
    assert told["cutting_force_n"][:2] == [None, None]
    assert told["force_reasons"] == [[0, 1, "spindle below 50 rev/min: power over speed means nothing"]]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"spindle_rpm": [6000.0] * 2}, "lengths differ: ambient_temp_c 3, spindle_load_pct 3, spindle_rpm 2"),
        ({"feed_mm_min": [100.0]}, "lengths differ: ambient_temp_c 3, spindle_load_pct 3, spindle_rpm 3, feed_mm_min 1"),
        ({"start_temp_c": -20.1}, "start_temp_c is -20.1: "),
        ({"start_temp_c": 120.1}, "start_temp_c is 120.1: "),
        ({"spindle_load_pct": [0.0, 200.1, 0.0]}, "spindle_load_pct.1 is 200.1: "),
        ({"spindle_load_pct": [-0.1, 0.0, 0.0]}, "spindle_load_pct.0 is -0.1: "),
        ({"spindle_rpm": [60_000.1, 0.0, 0.0]}, "spindle_rpm.0 is 60000.1: "),
        ({"ambient_temp_c": [20.0, 81.0, 20.0]}, "ambient_temp_c.1 is 81.0: "),
        ({"dt_s": 0.0}, "dt_s is 0.0: "),
        ({"dt_s": 60.1}, "dt_s is 60.1: "),
        ({"tool_diameter_mm": 0.0}, "tool_diameter_mm is 0.0: "),
        ({"spindle_rpm": []}, "spindle_rpm is []: "),
        ({"spindle_rpm": None}, "spindle_rpm is None: "),
        ({"spindle_rpm": "fast"}, "spindle_rpm is 'fast': "),
        ({"spindle_rpm": [[1.0]] * 3}, "spindle_rpm.0 is [1.0]: "),
        ({"dt": 1.0}, "dt is 1.0: Extra inputs are not permitted"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_400_with_a_line_that_names_it(client: Client, change: dict[str, Any], line: str) -> None:
    status, told = predict(client, {**PLAN, **change})
    assert status == 400
    assert told["error"].startswith(line)


ENDS: list[dict[str, Any]] = [
    {"start_temp_c": -20.0},
    {"start_temp_c": 120.0},
    {"dt_s": 60.0},
    {"spindle_load_pct": [0.0, 200.0, 0.0]},
    {"spindle_rpm": [0.0, 60_000.0, 0.0]},
]


@pytest.mark.parametrize("end", ENDS, ids=str)
def test_the_ends_of_the_ranges_are_in_them(client: Client, end: dict[str, Any]) -> None:
    assert predict(client, {**PLAN, **end})[0] == 200


@pytest.mark.parametrize("body", ["", "{", "[]", "null", '{"dt_s": NaN}', '{"start_temp_c": 1e999}', "x" * 100, "[" * 100_000])
def test_a_body_that_is_no_plan_is_400(client: Client, body: str) -> None:
    answer = client.post("/predict", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 400
    assert list(answer.json()) == ["error"]


def test_nan_inside_is_refused(client: Client) -> None:
    body = json.dumps({**PLAN, "spindle_rpm": [6000.0, math.nan, 6000.0]})
    answer = client.post("/predict", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 400


def test_a_course_and_a_body_have_a_length_that_is_bounded(client: Client) -> None:
    long = {**PLAN, **{name: [20.0] * 100_001 for name in ("ambient_temp_c", "spindle_load_pct", "spindle_rpm")}}
    status, told = predict(client, long)
    assert status == 400
    assert "at most 100000" in told["error"]
    huge = client.post("/predict", content=b" " * 8_000_001, headers={"Content-Type": "application/json"})
    assert huge.status_code == 413
    assert "longer than the 8000000 bytes" in huge.json()["error"]
    blocks = (b" " * 1_000_000 for _ in range(9))
    unsaid = client.post("/predict", content=_in_blocks(blocks), headers={"Content-Type": "application/json"})
    assert unsaid.status_code == 413
    assert "longer than the 8000000 bytes" in unsaid.json()["error"]


def test_the_longest_course_is_answered(client: Client) -> None:
    full = {
        **PLAN,
        "dt_s": 1.0,
        **{name: PLAN[name][:1] * 100_000 for name in ("ambient_temp_c", "spindle_load_pct", "spindle_rpm")},
    }
    status, told = predict(client, full)
    assert (status, len(told["spindle_temp_c"])) == (200, 100_000)


def test_the_same_plan_has_the_same_answer_after_a_restart(client: Client) -> None:
    with client_of() as anew:
        assert predict(anew, PLAN) == predict(client, PLAN)


def test_a_configuration_that_is_wrong_is_said_before_anything_is_served(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[thermal]\nresistance_k_per_w = 0.0\n")
    with pytest.raises(ConfigurationError, match="resistance_k_per_w"):
        Constants(file)


async def _in_blocks(blocks: Iterator[bytes]) -> AsyncIterator[bytes]:
    for block in blocks:
        yield block


def test_a_described_machine_is_predicted_with_its_file_and_every_effect_of_it() -> None:
    heat = {"alpha_w_per_pct_rpm2": 0.0, "beta_w_per_rpm": 0.02, "resistance_k_per_w": 0.1, "capacity_j_per_k": 1000.0}
    drive = {"rated_power_kw": 10.0, "efficiency": 0.8, "idle_power_kw": 0.0}
    tools = {"3": {"diameter_mm": 20.0, **CUTTER}, "7": {"diameter_mm": 10.0, **CUTTER}}
    coolant = {"effect": "coolant_cooling", "parameters": {"gain": 1.0}}
    known = described_as(
        coolant, {"effect": "rated_power", "parameters": {"scale": 1.5}}, thermal=heat, spindle=drive, tools=tools
    )
    descriptions = LiveDescriptions()
    with client_of(constants=Constants(None, descriptions.of)) as client:
        assert predict(client, {**PLAN, "machine": "vmc"})[1]["basis"]["thermal"].startswith("defaults")
        message = DescriptionMessage(version=known.version, toml=machine_to_toml(known.machine))
        descriptions.take("cnctwin/description/vmc/live", message.payload())
        plan = {**PLAN, "machine": "vmc", "spindle_rpm": [3000.0] * 3, "tool_number": 3}
        told = predict(client, plan)[1]
        cooled = predict(client, {**plan, "coolant_on": [True] * 3})[1]
        unknown = predict(client, {**plan, "tool_number": None})[1]
        descriptions.take("cnctwin/description/vmc/live", b"")
        assert predict(client, plan)[1]["basis"]["thermal"].startswith("defaults")
    assert told["spindle_temp_c"][-1] == pytest.approx(20.0 + 6.0 * (1.0 - math.exp(-1.8)), abs=1e-4)
    assert cooled["spindle_temp_c"][-1] == pytest.approx(20.0 + 3.0 * (1.0 - math.exp(-3.6)), abs=1e-4)
    # 50 % of 15 kW at an efficiency of 0.8 are 6 kW; a 20 mm tool at 3,000 rev/min cuts at 3.1416 m/s
    assert told["cutting_force_n"] == pytest.approx([6000.0 / math.pi] * 3, abs=0.1)
    assert told["basis"]["cutting_force"] == (
        f"description {known.version}; 10 kW rated, efficiency 0.8; with rated_power scale 1.5"
    )
    assert unknown["force_reasons"][0][2] == "the machine has several tools, and no tool_number says which one it is"


def test_a_message_that_describes_nothing_changes_nothing() -> None:
    descriptions = LiveDescriptions()
    descriptions.take("cnctwin/description/vmc/live", b"{}")
    descriptions.take("cnctwin/description/vmc/fault", b"{}")
    descriptions.take("cnctwin/description/vmc/live", DescriptionMessage(version="x", toml="[machine]").payload())
    assert descriptions.of("vmc") is None
