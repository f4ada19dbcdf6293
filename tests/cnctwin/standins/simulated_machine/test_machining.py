"""What the control shows is what the simulation says, and the spare part is what would be computed."""

import re

import numpy as np
import pytest

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import program_text
from cnctwin.standins.simulated_machine.machining import machined, moments_of_run
from cnctwin.standins.simulated_machine.part import Part, spare_part
from twin.simulator.simulation import Simulation, simulate


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """One part without noise."""
    return simulate(machine_as_built(), program_text(), start_temperature_c=30.0)


def course(part: Part, key: str) -> list[tuple[float, str]]:
    """Return what one key says, and when it says something new."""
    told = [(moment.at_s, moment.values[key]) for moment in part.moments if key in moment.values]
    return [(at_s, value) for n, (at_s, value) in enumerate(told) if n == 0 or told[n - 1][1] != value]


def test_what_is_shown_is_what_the_simulation_says(simulation: Simulation) -> None:
    run, blocks = simulation.run, program_text().splitlines()
    moments = list(moments_of_run(run, blocks, {"x": 30.0, "y": 36.0, "z": 30.0}))
    for moment in moments[:: len(moments) // 50]:
        tick = round(moment.at_s / 0.001)
        for axis in "xyz":
            assert float(moment.values[f"{axis.upper()}abs"]) == pytest.approx(run[f"{axis}_pos_mm"][tick], abs=0.00051)
        assert float(moment.values["Srpm"]) == pytest.approx(run["spindle_rpm"][tick], abs=0.51)
        assert float(moment.values["Sload"]) == pytest.approx(run["spindle_load_pct"][tick], abs=0.051)
        assert moment.values["block"] == blocks[int(run["line"][tick])].strip()
        assert (moment.values["Tool_number"] == "") == bool(run["tool_change_active"][tick])
    assert np.diff([moment.at_s for moment in moments[:-1]]) == pytest.approx(0.1)
    assert moments[-1].at_s == pytest.approx(simulation.seconds, abs=0.001)
    assert all(0.0 <= float(moment.values["Xload"]) <= 100.0 for moment in moments)


def test_every_tool_change_of_the_program_is_shown(simulation: Simulation) -> None:
    commanded = re.findall(r"^T\d+ M6", program_text(), re.M)
    moments = moments_of_run(simulation.run, program_text().splitlines(), {})
    numbers = [value for _, value in course(Part(tuple(moments), 0.0), "Tool_number")]
    assert len(commanded) == 5
    assert numbers == ["", "1", "", "2", "", "3", "", "4", "", "5"]


def test_three_tools_are_changed_in_the_first_minute(simulation: Simulation) -> None:
    begins = np.flatnonzero(np.diff(simulation.run["tool_change_active"], prepend=0.0) > 0.0)
    assert np.count_nonzero(simulation.run.t_s[begins] < 60.0) >= 3


def test_the_program_is_one_that_a_machinist_would_run(simulation: Simulation) -> None:
    assert not [note for note in simulation.notes if "rapid into material" in note]
    run, cut = simulation.run, simulation.run["axial_depth_mm"] > 0.0
    assert 0.15 < cut.mean() < 0.6, "it cuts for a good part of its time"
    assert run["spindle_load_pct"].max() < 60.0
    assert all(np.abs(error).max() < 20.0 for error in simulation.following_error_mm().values())
    for axis in "xyz":
        limit = machine_as_built().axes[axis].torque_limit_a
        assert np.abs(run[f"{axis}_torque_a"]).max() < limit, axis
        assert run[f"{axis}_ref_mm"][0] == run[f"{axis}_ref_mm"][-1] == 0.0, "the next part starts where this one ends"


def test_two_parts_are_not_equal() -> None:
    one, two = machined(1, machine_as_built()), machined(2, machine_as_built())
    assert one.seconds == two.seconds
    assert course(one, "Xabs") != course(two, "Xabs")


def test_the_spare_part_is_the_first_one_as_it_is_computed() -> None:
    """Where this fails: scripts/make-recording."""
    computed, spare = machined(1, machine_as_built()), spare_part()
    assert spare.seconds == pytest.approx(computed.seconds, abs=0.01)
    for key in ("Tool_number", "block"):
        assert course(spare, key) == course(computed, key), key
    assert course(spare, "coolant") == course(computed, "coolant")[1:], "off is what it was before"
    for axis in "XYZ":
        there, here = dict(course(spare, f"{axis}abs")), dict(course(computed, f"{axis}abs"))
        both = there.keys() & here.keys()
        assert len(both) > 0.7 * len(here)
        assert max(abs(float(there[at_s]) - float(here[at_s])) for at_s in both) < 0.01
