"""Defects that are put back in on purpose are found, each by the invariant that it breaks; a failing seed says all there is."""

import pytest

from tests.plant.simulation.defects import DEFECTS
from tests.plant.simulation.run import Result, invariant_of, lived

FOUND = {  # the first seed that finds it, and what it breaks
    "receipts-before-sync": (1, "no row that was receipted is lost"),
    "no-receipts": (1, "no observation is lost unsaid"),
    "claim-unseen": (3, "no alert twice"),
    "key-without-machine": (1, "no sender changes another machine"),
    "short-way-forgets": (3, "a state is its fold"),
    "no-gate": (1, "all comes to its end"),
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
