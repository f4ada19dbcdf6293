"""The kernels of a production diagnosis are compiled ahead."""

import pytest

from tests.twin.gap.stages.produced import case_with
from twin.gap.diagnose import diagnose
from twin.gap.warm_kernels import warm_kernels
from twin.kernels import assembly
from twin.kernels.generated import compiled


def test_a_diagnosis_of_production_compiles_nothing_more(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: set[str] = set()

    def watched(text: str) -> object:
        seen.add(text)
        return compiled(text)

    monkeypatch.setattr(assembly, "compiled", watched)
    warm_kernels()
    ahead = set(seen)
    assert len(ahead) >= 5
    diagnose(case_with(slope_pct=6.0))
    assert seen == ahead
