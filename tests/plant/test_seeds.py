"""A slice of seeds: whole plants with the faults that each draws (docs/explanation/plant-simulation.md)."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.plant.simulation.faults import KINDS, drawn
from tests.plant.simulation.plant import FAULTS_UNTIL_S
from tests.plant.simulation.run import lived

ROOT = Path(__file__).parents[2]
SEEDS = (1, 3, 5, 6)
ONE = "from tests.plant.simulation.run import lived; result = lived(6); print(result.events, result.digest)"


@pytest.mark.parametrize("seed", SEEDS)
def test_a_plant_keeps_what_it_promises_whatever_happens_to_it(seed: int) -> None:
    result = lived(seed)
    assert not result.violations, result.report
    assert result.events > 1_000, "a plant in which nothing happens keeps every promise"


def test_a_seed_is_the_same_plant_in_each_process() -> None:
    told = set()
    for hash_seed in ("0", "1"):
        environment = os.environ | {"PYTHONHASHSEED": hash_seed}
        ran = subprocess.run([sys.executable, "-c", ONE], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        told.add(ran.stdout)
    assert len(told) == 1, told


def test_every_kind_of_fault_is_drawn_and_leaving_one_out_leaves_the_others() -> None:
    faults = {seed: drawn(seed, FAULTS_UNTIL_S) for seed in range(100)}
    assert {fault.kind for found in faults.values() for fault in found} == set(KINDS)
    for seed, found in faults.items():
        assert drawn(seed, FAULTS_UNTIL_S, frozenset({"cut"})) == [fault for fault in found if fault.kind != "cut"]
