"""What a simulated control shows, and when."""

from itertools import pairwise

from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production, tool_changes


def test_ten_minutes_hold_parts_with_five_tool_changes_each() -> None:
    shown = list(production(600.0))
    changes = tool_changes(shown)
    assert [change.tool_number for change in changes[:7]] == [1, 2, 3, 4, 5, 1, 2]
    assert all(2.0 < change.to_s - change.from_s < 8.0 for change in changes)
    assert shown[-1].part_count == 4  # of 115 s, and the pause after each
    assert all(a.at_s <= b.at_s for a, b in pairwise(shown))


def test_it_shows_the_state_of_its_own_time_and_stays_at_the_last() -> None:
    at_s = 0.0
    control = SimulatedControl(production(60.0), machine_s=lambda: at_s, switched_on_s=1_000.0, clock_offset_s=2.5)
    assert control.now().tool_number == 5
    at_s = 2.05
    assert control.now().is_changing_tool
    assert control.now().block == "T1 M6"
    at_s = 5.3
    assert control.now().tool_number == 1
    assert control.calendar_s() == 1_007.8
    at_s = 1e6
    assert control.now().at_s <= 60.0
    assert control.is_over
