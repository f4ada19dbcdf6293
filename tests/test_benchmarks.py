"""The benchmarks run; what they measure is not tested, since a machine is never quiet."""

import importlib.util
from pathlib import Path

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


def test_every_message_of_the_sample_path_brings_a_result() -> None:
    spec = importlib.util.spec_from_file_location("sample_path", BENCHMARKS / "sample_path.py")
    assert spec is not None and spec.loader is not None
    sample_path = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sample_path)
    stages = sample_path.stages(200)
    assert set(stages) == {"floor", "decode", "fold", "encode"}
    assert all(figure >= 0.0 for figure in stages.values())
