"""A diagnosis is judged: filed where it is better on runs that it was not fitted to, else refused with its reason."""

import json
from pathlib import Path
from typing import Any

import pytest

from cnctwin.composing.compose import compose
from cnctwin.loop.judging import judged
from tests.cnctwin.composing.made_up import DESCRIPTION, store_of_days

COOLED = DESCRIPTION + '\n[[effects]]\neffect = "coolant_cooling"\nparameters = { gain = GAIN }\n'
CAUSE = {"effect": "coolant_cooling", "on": "", "probability": 0.9, "parameters": {}}
RIVAL = {"effect": "speed_convection", "on": ""}
GAP = {"before": 3.0, "after": 1.0, "by_signal": {"spindle_temp_c": {"before": 0.62, "after": 0.22, "floor": 0.2, "unit": "°C"}}}


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two days of a machine whose coolant cools: one is fitted, one is for judging."""
    folder = tmp_path_factory.mktemp("judging")
    store = store_of_days(folder / "store", 2, coolant_gain=2.0)
    compose(store, "vmc", DESCRIPTION, folder / "case")
    store.close()
    return folder / "case"


def result(folder: Path, toml: str, **diagnosis: Any) -> Path:
    told = {"verdict": "explained", "sentence": "95 % is coolant.", "causes": [CAUSE], "gap": GAP, **diagnosis}
    (folder / "diagnosis.json").write_text(json.dumps(told))
    (folder / "twin.toml").write_text(toml)
    return folder


def test_what_is_better_on_other_runs_is_filed_in_plain_words(case: Path, tmp_path: Path) -> None:
    cause = CAUSE | {"indistinguishable_from": [RIVAL]}
    found = judged(case, result(tmp_path, COOLED.replace("GAIN", "2.0"), causes=[cause]), DESCRIPTION)
    assert found.is_better and found.card.score is not None
    assert found.card.score.challenger < found.card.score.live and found.card.score.runs > 0
    assert found.card.sentence.startswith("coolant cools (or ")
    assert found.card.sentence.endswith(": gap of the spindle temperature 3.1 → 1.1 × the repeatability")
    assert found.card.signal == "spindle_temp_c"


@pytest.mark.parametrize(
    ("gain", "diagnosis", "says"),
    [
        (0.0, {}, "no better on"),
        (2.0, {"verdict": "healthy", "causes": []}, "no gap beyond the repeatability"),
        (2.0, {"verdict": "unknown", "causes": [], "next_experiment": {"why": "switches the coolant"}}, "switches the coolant"),
    ],
)
def test_what_is_not_is_refused_with_its_reason(
    case: Path, tmp_path: Path, gain: float, diagnosis: dict[str, Any], says: str
) -> None:
    found = judged(case, result(tmp_path, COOLED.replace("GAIN", str(gain)), **diagnosis), DESCRIPTION)
    assert not found.is_better and says in found.text and "95 % is coolant." in found.text


def test_constants_that_moved_are_filed_where_they_close_the_gap(case: Path, tmp_path: Path) -> None:
    moved = {"verdict": "healthy", "causes": [], "constants": [{"name": "thermal.resistance_k_per_w"}]}
    found = judged(case, result(tmp_path, COOLED.replace("GAIN", "2.0"), **moved), DESCRIPTION)
    assert found.is_better and found.card.says == "constants differ from what was stated"
