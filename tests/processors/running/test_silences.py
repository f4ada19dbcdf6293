"""Machines are asked whether they are silent only when they may be; the ticks are those of asking all, all the time."""

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from processors.running.engine import Engine
from processors.running.silences import Silences
from processors.running.unit import Machine
from tests.processors.recorder import RECORDER
from tests.processors.streams import birth, data, death, engine_of

MACHINES = ("vmc", "lathe", "grinder")


class Asked(Silences):
    """Asks all machines each time, by name."""

    engine: Engine

    def due(self, wall_s: float) -> list[Machine]:
        return [machine for _, machine in sorted(self.engine._machines.items())]


@given(seed=st.integers(0, 2**32))
@settings(max_examples=60, deadline=None)
def test_the_ticks_are_those_of_asking_every_machine_at_every_turn(seed: int) -> None:
    chance = Random(seed)
    watched, asked = (engine_of(RECORDER, gap_s_max=20.0) for _ in range(2))
    asked.silences = Asked(asked.silences.margin_s)
    asked.silences.engine = asked
    wall_s = at_s = 0.0
    for _ in range(60):
        machine = chance.choice(MACHINES)
        at_s += chance.choice((0.0, 0.1, 0.4, 3.0, 40.0))
        wall_s += chance.choice((0.0, 0.05, 0.3, 1.1, 4.0, 30.0))
        skew_s = chance.choice((0.0, 0.0, 0.0, -0.5, -100.0))
        made = {0: birth, 1: death}.get(chance.randrange(12))
        values = {"spindle_rpm": chance.uniform(0.0, 9e3)}
        event = (
            death(at_s, device=machine) if made is death else (made or data)(max(at_s + skew_s, 0.0), device=machine, **values)
        )
        assert watched.feed(event, wall_s) == asked.feed(event, wall_s)
        assert watched.silence(wall_s) == asked.silence(wall_s)
    assert watched.counts == asked.counts
    for unit in sorted(watched.known_units):
        assert watched.snapshot(unit) == asked.snapshot(unit)


def test_a_machine_that_talks_is_looked_at_every_few_seconds_only() -> None:
    engine = engine_of(RECORDER)
    engine.feed(birth(0.0, spindle_rpm=1.0), 0.0)
    looks = 0
    for tenth in range(1, 601):
        engine.feed(data(tenth / 10, spindle_rpm=float(tenth)), tenth / 10)
        before = [entry[1] for entry in engine.silences._due]
        engine.silence(tenth / 10)
        looks += before != [entry[1] for entry in engine.silences._due]
    assert looks <= 30
    assert len(engine.silences._due) == 1
