"""A slice of the grid of `benchmarks/tool_change_detector.py`: four hours in place of days."""

from benchmarks import tool_change_detector


def test_at_10_db_nine_of_ten_changes_are_found_under_stretch_and_stall() -> None:
    row = tool_change_detector.grid(hours=4.0, seeds=1, snrs_db=(10.0,), count=30)[0]
    assert all(recall >= 0.9 for recall, _, _ in row["recall"].values()), row
    assert row["false_per_day"][1] <= 24.0, "the interval of four hours has to hold a few a day"


def test_the_cost_is_measured_beside_scipy() -> None:
    cost = tool_change_detector.cost(samples=2000, repeats=2)
    assert cost["ratio"] > 5.0, cost
