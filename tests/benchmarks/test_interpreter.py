"""The benchmark of the interpreter runs; what it measures is not tested, since a machine is never quiet."""

from benchmarks import interpreter


def test_the_benchmark_measures_us_and_its_yardsticks() -> None:
    found = interpreter.measure(400, 1)
    assert set(found) == {"ours", "re.findall", "rs274", "ours, macro loop"}
    assert all(rate is None or rate > 0.0 for rate in found.values())
