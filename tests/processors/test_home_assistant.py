"""Home Assistant: off until it is asked for, valid by its own rules, withdrawn when it is asked for no longer."""

import json
from typing import Any

import jinja2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from processors.home_assistant import PREFIX, identifier, topic_of
from processors.mirror import PROCESSOR
from processors.outputs import declared_outputs
from processors.running.engine import Engine
from sparkplug.host_session import EventKind
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.processors.home_assistant_rules import check
from tests.processors.streams import T0_MS, birth, data, death, engine_of, event, fed, plain, reading
from twin.vocabulary.signals import SIGNALS

OKUMA = topic_of("okuma")


def shown(actions: Any, machine: str = "okuma") -> dict[str, dict[str, Any]]:
    """The entities of the announcement among these actions, which keeps the rules."""
    topic = topic_of(machine)
    return check(topic, json.loads(plain(actions)[topic]))


def asked(**table: Any) -> Engine:
    return engine_of(PROCESSOR, home_assistant=True, **table)


def every_signal() -> tuple[Reading, ...]:
    """All signals of the vocabulary and of the twin, null, as a birth may have them."""
    units = {name: one.unit for name, one in SIGNALS.items()} | {name: one.unit or "" for name, one in declared_outputs().items()}
    return tuple(Reading(name, None, T0_MS, Quality.BAD, unit or None, "not yet", False) for name, unit in units.items())


def test_nothing_is_said_to_home_assistant_until_it_is_asked_for() -> None:
    actions = fed(engine_of(PROCESSOR), birth(0.0, spindle_rpm=1.0), data(1.0, spindle_rpm=2.0), death(2.0))
    assert [topic for topic in plain(actions) if topic.startswith("homeassistant/")] == []


def test_a_birth_announces_the_machine_with_what_is_known_of_it() -> None:
    engine = asked()
    found = shown(fed(engine, birth(0.0, spindle_rpm=1.0, program="O1", coolant_on=True)))
    assert found["spindle_rpm"] == {
        "platform": "sensor",
        "unique_id": "cnctwin_okuma_spindle_rpm",
        "name": "spindle rpm",
        "state_topic": "cnc/okuma/spindle_rpm",
        "availability": [
            {
                "topic": "cnc/okuma/spindle_rpm",
                "value_template": "{{ 'offline' if value_json.quality == 'stale' else 'online' }}",
            }
        ],
        "value_template": "{{ value_json.value if value_json.quality != 'bad' else none }}",
        "unit_of_measurement": "rpm",
        "state_class": "measurement",
    }
    assert {name: one["platform"] for name, one in found.items()} == {
        "spindle_rpm": "sensor", "program": "sensor", "coolant_on": "binary_sensor",
    }  # fmt: skip
    twin = birth(1.0, node=NodeId("cnc", "twin-thermal"), **{"twin/spindle_temp_c": None})
    assert set(shown(fed(engine, twin))) == {*found, "twin-spindle_temp_c"}
    assert OKUMA not in plain(fed(engine, data(2.0, spindle_rpm=3.0), death(3.0)))


def test_a_plc_address_that_is_a_flag_is_one_here_too_and_lists_of_alarms_are_no_entities() -> None:
    found = shown(fed(asked(), birth(0.0, plc_door_open=False, plc_pressure=3.5, alarms="[]", spindle_rpm=1.0)))
    assert found["plc_door_open"]["platform"] == "binary_sensor"
    assert found["plc_pressure"]["platform"] == "sensor"
    assert "alarms" not in found


def test_what_is_chosen_by_address_is_announced_though_it_was_null_from_the_start() -> None:
    engine = asked()
    nulls = [
        Reading(name, None, T0_MS, Quality.BAD, unit, "BadNodeIdUnknown", False)
        for name, unit in (("plc_spindle_oil", "bar"), ("variable_offset", None), ("plc_door_open", None))
    ]
    found = shown(fed(engine, event(EventKind.BIRTH, 0.0, *nulls)))
    assert {name: one["platform"] for name, one in found.items()} == dict.fromkeys(
        ("plc_spindle_oil", "variable_offset", "plc_door_open"), "sensor"
    )
    assert found["plc_spindle_oil"]["unit_of_measurement"] == "bar"
    again = shown(fed(engine, birth(1.0, plc_spindle_oil=4.5, variable_offset=0.25, plc_door_open=True)))
    assert again["plc_door_open"]["platform"] == "binary_sensor", "a birth shows that it is a flag"
    assert again["variable_offset"]["state_class"] == "measurement"


def test_every_signal_there_is_can_be_announced_though_it_is_null() -> None:
    found = shown(fed(asked(home_assistant_entities_max=500), event(EventKind.BIRTH, 0.0, *every_signal())))
    classes = {name: (one.get("device_class"), one.get("unit_of_measurement")) for name, one in found.items()}
    assert classes["spindle_temp_c"] == ("temperature", "°C")
    assert classes["spindle_power_kw"] == ("power", "kW")
    assert classes["twin-spindle_temp_residual_k"] == (None, "K")
    assert classes["feed_mm_min"] == (None, "mm/min")
    assert classes["twin-anomaly_alarm"] == ("problem", None)
    assert found["twin-spindle_temp_basis"]["entity_category"] == "diagnostic"
    assert found["nc_line"].get("state_class") is None
    assert "twin-part_record" not in found
    assert len(found) > 100


def test_only_so_many_entities_are_announced_the_figures_first_and_the_device_says_so() -> None:
    actions = fed(asked(home_assistant_entities_max=5), event(EventKind.BIRTH, 0.0, *every_signal()))
    assert len(shown(actions)) == 5
    assert "twin-spindle_temp_basis" not in shown(actions)
    model = json.loads(plain(actions)[OKUMA])["device"]["model"]
    assert model.startswith("CNC machine tool, 5 of ")


def test_arrays_bytes_and_a_challengers_signals_are_no_entities() -> None:
    odd = birth(0.0, block=(1.0, 2.0), raw=b"x", nothing=None, **{"twin/challenger/spindle_temp_c": 1.0, "spindle_rpm": 1.0})
    assert set(shown(fed(asked(), odd))) == {"spindle_rpm"}


def test_a_signal_that_is_gone_is_removed_by_name() -> None:
    engine = asked(home_assistant_entities_max=1)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    actions = fed(engine, birth(1.0, axis_x_pos_mm=2.0))
    assert set(shown(actions)) == {"axis_x_pos_mm"}
    assert json.loads(plain(actions)[OKUMA])["components"]["spindle_rpm"] == {"platform": "sensor"}


@pytest.mark.parametrize("table", [{}, {"home_assistant": True, "machines": {"okuma": {"home_assistant": False}}}])
def test_a_machine_is_withdrawn_once_when_it_is_asked_for_no_longer(table: dict[str, Any]) -> None:
    before = asked()
    fed(before, birth(0.0, spindle_rpm=1.0))
    after = engine_of(PROCESSOR, **table)
    after.restore(before.snapshot("okuma"))
    assert plain(fed(after, birth(1.0, spindle_rpm=1.0)))[OKUMA] == b""
    assert OKUMA not in plain(fed(after, data(2.0, spindle_rpm=2.0), birth(3.0, spindle_rpm=1.0)))


def test_a_machine_that_never_comes_back_is_withdrawn_too() -> None:
    before = asked()
    fed(before, birth(0.0, spindle_rpm=1.0))
    after = engine_of(PROCESSOR)
    after.restore(before.snapshot("okuma"))
    assert plain(after.bury_unborn(T0_MS))[OKUMA] == b""


def test_a_restart_announces_the_same_again() -> None:
    before, after = asked(), asked()
    first = plain(fed(before, birth(0.0, spindle_rpm=1.0, program="A")))[OKUMA]
    after.restore(before.snapshot("okuma"))
    assert plain(fed(after, birth(1.0, spindle_rpm=1.0, program="A")))[OKUMA] == first


@pytest.mark.parametrize(
    ("one", "state"),
    [
        (reading("spindle_rpm", 2400.5), ("2400.5", "online")),
        (reading("spindle_rpm", None, quality=Quality.BAD, reason="no reading"), ("None", "online")),
        (reading("spindle_rpm", 7.0, quality=Quality.BAD), ("None", "online")),
        (reading("spindle_rpm", 7.0, quality=Quality.STALE), ("7.0", "offline")),
        (reading("program", "O1"), ("O1", "online")),
        (reading("program", "x" * 300), ("x" * 255, "online")),
        (reading("program", None), ("None", "online")),
        (reading("coolant_on", True), ("ON", "online")),
        (reading("coolant_on", False), ("OFF", "online")),
        (reading("coolant_on", None), ("None", "online")),
    ],
)
def test_the_templates_make_states_of_what_the_mirror_says(one: Reading, state: tuple[str, str]) -> None:
    """`None` is what Home Assistant takes for unknown."""
    actions = fed(asked(), event(EventKind.BIRTH, 0.0, one))
    entity = shown(actions)[one.name]
    said = json.loads(plain(actions)[entity["state_topic"]])
    templates = (entity["value_template"], entity["availability"][0]["value_template"])
    assert tuple(jinja2.Template(template).render(value_json=said) for template in templates) == state


@given(st.text(max_size=120), st.text(max_size=120))
def test_no_two_names_share_an_id_and_all_ids_are_taken(one: str, other: str) -> None:
    assert (identifier(one) == identifier(other)) is (one == other)
    assert set(identifier(one)) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


@pytest.mark.parametrize("machine", ["vmc", "cell 4/Fräse #1+", "a/b", "a-b", "x" * 300, "-", "jobs2"])
def test_a_machine_of_any_name_is_announced_below_our_own_prefix(machine: str) -> None:
    actions = fed(asked(), birth(0.0, device=machine, **{"spindle_rpm": 1.0, "Öl/Druck #1": 2.0, "twin/a b": "c"}))
    assert len(shown(actions, machine)) == 3
    assert topic_of(machine).startswith(PREFIX)
    assert json.loads(plain(actions)[topic_of(machine)])["device"]["name"] == machine
