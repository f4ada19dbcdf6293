"""The benchmark of the interpreter runs; what it measures is not tested, since a machine is never quiet."""

import importlib.util
from pathlib import Path

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "interpreter.py"


def test_the_benchmark_measures_us_and_its_yardsticks() -> None:
    spec = importlib.util.spec_from_file_location("interpreter_benchmark", BENCHMARK)
    assert spec is not None and spec.loader is not None
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    found = benchmark.measure(400, 1)
    assert set(found) == {"ours", "re.findall", "rs274", "ours, macro loop"}
    assert all(rate is None or rate > 0.0 for rate in found.values())
