"""Arrays of a model's file: what they become is known before they are unpacked."""

import numpy as np
import pytest

from twin.forest import artefact
from twin.forest.artefact import packed, unpacked
from twin.forest.errors import ForestError


def test_arrays_that_would_unfold_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    data = packed({"a": np.zeros(1_000_000)})
    assert len(data) < 50_000
    assert len(unpacked(data, "model")["a"]) == 1_000_000
    monkeypatch.setattr(artefact, "BYTES_MAX", 8_000_000)
    with pytest.raises(ForestError, match=r"model: unpacks to 8000\d+ bytes; 8000000 are read"):
        unpacked(data, "model")
