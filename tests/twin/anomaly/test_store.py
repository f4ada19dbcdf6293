"""Models stand beside each other; which one scores is a link that is turned in one move."""

from pathlib import Path

import numpy as np
import pytest

from tests.twin.anomaly.models import calibration, rows, small_model
from twin.anomaly.errors import ModelError
from twin.anomaly.model import load_model, load_models
from twin.anomaly.store import current_of, promote, stored, versions_of


def test_a_model_scores_once_it_is_promoted_and_the_one_before_can_come_back(tmp_path: Path) -> None:
    first, second = small_model(seed=1), small_model(seed=2)
    one = stored(first, tmp_path, "vmc")
    assert current_of(tmp_path, "vmc") is None
    assert promote(tmp_path, "vmc", one.name) is None
    two = stored(second, tmp_path, "vmc")
    assert current_of(tmp_path, "vmc") == one.name
    assert promote(tmp_path, "vmc", two.name[:5]) == one.name
    judged = rows(20, 5)
    assert np.array_equal(load_models(tmp_path)["vmc"].scores(judged), second.scores(judged))
    promote(tmp_path, "vmc", one.name)
    assert np.array_equal(load_model(tmp_path / "vmc").scores(judged), first.scores(judged))
    assert set(versions_of(tmp_path, "vmc")) == {one.name, two.name}


def test_a_version_is_named_by_what_is_in_it(tmp_path: Path) -> None:
    model = small_model()
    assert stored(model, tmp_path, "vmc") == stored(model, tmp_path, "vmc")
    other = stored(model.calibrated(calibration()), tmp_path, "vmc")
    assert other != stored(model, tmp_path, "vmc")
    assert len(other.name) == 12


def test_a_version_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path) -> None:
    version = stored(small_model(), tmp_path, "vmc").name
    for wrong in ("zz", "", "../other", "current"):
        with pytest.raises(ModelError, match=f"there are {version}"):
            promote(tmp_path, "vmc", wrong)


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "a/b", "a\\b", "a\0", "x" * 201])
def test_a_name_that_leads_elsewhere_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="cannot name a folder"):
        stored(small_model(), tmp_path, name)


def test_each_machine_has_its_own(tmp_path: Path) -> None:
    for machine in ("vmc 1", "vmc-2"):
        promote(tmp_path, machine, stored(small_model(), tmp_path, machine).name)
    assert list(load_models(tmp_path)) == ["vmc 1", "vmc-2"]
    assert not list(tmp_path.rglob(".*"))
