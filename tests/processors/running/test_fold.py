"""Outputs that a step gives again as the same tuple are compared once; whatever was published in between counts."""

from dataclasses import replace
from typing import Any

from processors.config import ProcessorConfig
from processors.contract import NoState, Output, PlainOutput, Sample, SampleKind
from tests.processors.recorder import RECORDER
from tests.processors.streams import birth, data, engine_of, fed, published

SAME = (Output("twin/count", 1),)
OTHER = (Output("twin/count", 2),)
BESIDE = (PlainOutput("recorder/x", b""), Output("twin/count", 3))


def step(_config: ProcessorConfig, state: NoState, sample: Sample) -> tuple[NoState, tuple[Any, ...]]:
    rpm, _ = sample.number("spindle_rpm")
    if sample.kind is SampleKind.TICK or rpm is None:
        return state, ()
    return state, {1.0: SAME, 2.0: OTHER, 3.0: BESIDE}[rpm]


GIVES_THE_SAME = replace(RECORDER, step=step, state=NoState, initial=lambda _config: NoState())


def counts_after(*speeds: float) -> list[int]:
    engine = engine_of(GIVES_THE_SAME)
    stream = [birth(0.0, spindle_rpm=1.0), *(data(0.01 * i, spindle_rpm=rpm) for i, rpm in enumerate(speeds, start=1))]
    return [value for _, name, value, _ in published(fed(engine, *stream)) if name == "twin/count"]


def test_what_is_given_again_is_published_once() -> None:
    assert counts_after(1.0, 1.0, 1.0) == [1]


def test_what_was_published_in_between_makes_it_news_again() -> None:
    assert counts_after(1.0, 1.0, 2.0, 1.0, 1.0) == [1, 2, 1]
    assert counts_after(1.0, 1.0, 3.0, 1.0) == [1, 3, 1]


def test_a_restart_forgets_what_was_compared() -> None:
    engine, again = engine_of(GIVES_THE_SAME), engine_of(GIVES_THE_SAME)
    fed(engine, birth(0.0, spindle_rpm=1.0), data(0.1, spindle_rpm=2.0), data(0.2, spindle_rpm=2.0))
    again.restore(engine.snapshot("okuma"))
    actions = fed(again, birth(0.3, spindle_rpm=2.0), data(0.4, spindle_rpm=1.0))
    assert [value for _, _, value, _ in published(actions)] == [1]
