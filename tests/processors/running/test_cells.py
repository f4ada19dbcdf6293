"""Folds over a cell: which samples come, what each sees of the others, and what is kept."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import pytest

from processors.actions import DeadLetter, Publish
from processors.config import CellConfig, Configuration
from processors.contract import CellProcessor, Output, OutputSpec, Provenance, Sample, SampleKind
from processors.errors import ConfigurationError
from processors.running.engine import Engine
from sparkplug.datatype import DataType
from tests.processors.streams import T0_MS, birth, data, death, engine_of, fed, published


class Config(CellConfig):
    """The weight of a machine."""

    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class State:
    """What came: (kind, machine, machines in sight)."""

    log: tuple[tuple[str, str, tuple[str, ...]], ...] = ()


def step(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Tell every machine the weighted sum of all speeds."""
    state = State((*state.log, (sample.kind.value, sample.machine or sample.detail, tuple(sample.cell))))
    if sample.kind is not SampleKind.DATA:
        return state, ()
    speeds = {machine: config.of(machine).weight * float(row["spindle_rpm"].value) for machine, row in sample.cell.items()}
    total = sum(speeds.values())
    return state, [Output("twin/total", total, machine=machine, at_s=sample.at_s - 1.0) for machine in sample.cell]


SUM = CellProcessor(
    name="sum",
    version=1,
    inputs=frozenset({"spindle_rpm"}),
    outputs=(OutputSpec("twin/total", DataType.DOUBLE, "rev/min", "sum of the cell", Provenance.INFERRED),),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    listens=("cnctwin/sum/+",),
    beats=True,
)


def log(engine: Engine, cell: str = "all") -> tuple[tuple[str, str, tuple[str, ...]], ...]:
    return engine.known_units[cell].live.state.log


def test_machines_that_stand_in_no_cell_are_in_one_together() -> None:
    engine = engine_of(SUM, cells={"mill": ["a"]})
    fed(
        engine,
        birth(0.0, device="a", spindle_rpm=1.0),
        birth(0.0, device="b", spindle_rpm=2.0),
        birth(0.0, device="c", spindle_rpm=3.0),
    )
    assert log(engine, "mill") == (("birth", "a", ("a",)),)
    assert log(engine) == (("birth", "b", ("b",)), ("birth", "c", ("b", "c")))


def test_a_fold_sees_the_rows_of_all_machines_that_are_online_and_may_speak_of_each() -> None:
    engine = engine_of(SUM, machines={"b": {"weight": 10.0}})
    fed(engine, birth(0.0, device="a", spindle_rpm=1.0), birth(0.0, device="b", spindle_rpm=2.0))
    actions = fed(engine, data(0.5, device="a", spindle_rpm=3.0))
    assert [(action.machine, action.changes[0].value) for action in actions if isinstance(action, Publish)] == [
        ("a", 23.0),
        ("b", 23.0),
    ]
    assert published(actions) == [(-500, "twin/total", 23.0, False)] * 2
    fed(engine, death(0.6, device="a"))
    assert log(engine)[-1] == ("death", "a", ("b",)), "online are the others"
    assert published(fed(engine, data(0.7, device="b", spindle_rpm=4.0))) == [(-300, "twin/total", 40.0, False)]


def test_a_result_for_a_machine_that_nobody_knows_is_a_dead_letter_and_changes_nothing() -> None:
    def stray(_: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
        return State((("stray", "", ()),)), [Output("twin/total", 1.0), Output("twin/total", 1.0, machine="nobody")]

    engine = engine_of(CellProcessor(**{field: getattr(SUM, field) for field in SUM.__dataclass_fields__} | {"step": stray}))
    actions = fed(engine, birth(0.0, spindle_rpm=1.0))
    assert [action for action in actions if isinstance(action, Publish)] == []
    letter = next(action for action in actions if isinstance(action, DeadLetter))
    assert "no machine of 'all'" in json.loads(letter.payload)["error"]
    assert log(engine) == ()


def test_plain_messages_and_beats_reach_every_cell_without_any_machine() -> None:
    engine = engine_of(SUM, cells={"mill": ["a"]})
    engine.plain("cnctwin/sum/ask", b"how much?", T0_MS)
    engine.beat(T0_MS + 1000)
    assert log(engine) == log(engine, "mill") == (("plain", "how much?", ()), ("beat", "", ()))
    assert sorted(engine.take_changed()) == ["all", "mill"]


def test_a_cell_is_saved_and_restored_as_one() -> None:
    first, second = engine_of(SUM), engine_of(SUM)
    opening = [
        birth(0.0, device="a", spindle_rpm=1.0),
        birth(0.2, device="b", spindle_rpm=2.0),
        data(0.5, device="a", spindle_rpm=3.0),
    ]
    fed(first, *opening)
    assert first.units == ("all",)
    assert second.restore(first.snapshot("all")) == "all"
    assert log(second) == log(first)
    again = [birth(0.5, device="a", spindle_rpm=3.0), birth(0.5, device="b", spindle_rpm=2.0)]
    assert published(fed(second, *again, data(0.9, device="b", spindle_rpm=7.0)))[-1] == (-100, "twin/total", 10.0, False)


def test_a_machine_that_moved_to_another_cell_starts_there_afresh() -> None:
    first, second = engine_of(SUM), engine_of(SUM, cells={"mill": ["a"]})
    fed(first, birth(0.0, device="a", spindle_rpm=1.0), birth(0.0, device="b", spindle_rpm=2.0))
    second.restore(first.snapshot("all"))
    fed(second, birth(1.0, device="a", spindle_rpm=1.0))
    assert log(second, "mill") == (("birth", "a", ("a",)),)


def test_a_machine_stands_in_one_cell_only() -> None:
    with pytest.raises(ConfigurationError, match="cells has a twice"):
        Configuration(Config, {"cells": {"mill": ["a"], "turn": ["a"]}}, name="sum")


def test_history_of_a_cell_folds_into_a_state_of_its_own() -> None:
    engine = engine_of(SUM)
    fed(engine, birth(0.0, device="a", spindle_rpm=1.0), data(-900.0, device="a", history=True, spindle_rpm=5.0))
    assert len(log(engine)) == 1
    assert engine.known_units["all"].history is not None
    assert json.loads(engine.snapshot("all"))["history"]["machines"]["a"]["row"]["spindle_rpm"][0] == 5.0
