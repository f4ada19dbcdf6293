"""Defects that are put back in on purpose are found, each by the invariant that it breaks; a failing seed says all there is."""

import pytest

from processors.config import Configuration
from tests.plant.simulation.defects import DEFECTS
from tests.plant.simulation.observed import ObservedEngine
from tests.plant.simulation.run import Result, invariant_of, lived
from tests.processors.recorder import RECORDER
from tests.processors.streams import birth, data

FOUND = {  # the first seed that finds it, and what it breaks
    "receipts-before-sync": (5, "no row that was receipted is lost"),
    "no-receipts": (1, "no observation is lost unsaid"),
    "claim-unseen": (3, "no alert twice"),
    "key-without-machine": (1, "no sender changes another machine"),
    "no-gate": (1, "the broker ends no connection of ours"),
}


def test_each_defect_has_a_seed() -> None:
    assert FOUND.keys() == DEFECTS.keys()


@pytest.mark.parametrize("defect", FOUND)
def test_a_defect_that_is_put_back_in_is_found(defect: str) -> None:
    seed, invariant = FOUND[defect]
    result = lived(seed, defect=defect)
    assert invariant in {invariant_of(violation) for violation in result.violations}, result.report
    check_report(result)


def check_report(result: Result) -> None:
    for fault in result.faults:
        assert str(fault) in result.report
    assert f"--replay {result.seed}" in result.report


def test_a_state_that_is_not_its_fold_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ObservedEngine, "remembers", True)
    engine = ObservedEngine(RECORDER, Configuration(RECORDER.config))
    for event in (birth(0.0, spindle_rpm=1.0), data(0.5, spindle_rpm=2.0)):
        engine.feed(event, 0.0)
    assert engine.differing() == []
    engine._given.pop()
    assert engine.differing() == ["okuma"]
