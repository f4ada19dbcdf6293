"""Training: judged on later time, chosen without it, and refused where there is no significant improvement."""

from dataclasses import replace

import numpy as np
import pytest

from tests.twin.residual.days import SMALL, recorded, small_model, wandering, with_residual
from twin.residual.errors import ResidualError
from twin.residual.features import PHYSICS, PUBLISHED
from twin.residual.judging import rmse
from twin.residual.model import Trained
from twin.residual.table import Recorded, table_of
from twin.residual.training import fitted, trained

QUICK = replace(SMALL, feature_set="published")


def test_a_second_mass_is_learned_and_the_gain_is_sure() -> None:
    held = small_model().model.held_out
    assert held.why_refused == ""
    assert held.gain.low > 0.6
    assert held.corrected_rmse_k < 0.5 * held.physics_rmse_k
    assert held.constant_rmse_k > 2.0 * held.corrected_rmse_k
    assert held.by_regime.keys() >= {"standing", "warm_up"}


def test_means_are_added_only_where_they_earn_their_place_before_the_held_out_time() -> None:
    done = small_model()
    assert done.model.trained.feature_set in ("remembering", "lean")
    assert done.choosing[done.model.trained.feature_set] < 0.8 * done.choosing["published"]
    of_now = with_residual(recorded(), 0.002 * recorded().signals["spindle_load_pct"] * recorded().signals["spindle_rpm"] / 100.0)
    assert trained(of_now, SMALL, Trained()).model.trained.feature_set == "published"


def test_what_is_held_out_does_not_change_the_model() -> None:
    """No leakage: other temperatures in the held-out time give the same forest and region, bit for bit, and another figure."""
    done, whole = small_model(), recorded()
    later = whole.t_s >= done.table.t_s[done.split.test[0]] - 1.0
    shifted = (whole.signals["spindle_temp_c"] - whole.signals[PHYSICS]) + np.where(later, 5.0, 0.0)
    other = trained(with_residual(whole, shifted), replace(SMALL, seed=1), done.model.trained)
    assert other.model.held_out.physics_rmse_k > done.model.held_out.physics_rmse_k + 1.0
    assert other.model.features == done.model.features
    for ours, theirs in ((done.model.forest.forest.arrays(), other.model.forest.forest.arrays()),
                         (done.model.region.arrays(), other.model.region.arrays())):  # fmt: skip
        assert all(np.array_equal(ours[name], theirs[name]) for name in ours)


@pytest.mark.parametrize("seed", [1, 4])
def test_a_residual_that_nothing_explains_gives_no_model(seed: int) -> None:
    try:
        held = trained(wandering(seed, 1200.0), QUICK, Trained()).model.held_out
    except ResidualError as error:
        assert "record more" in str(error)  # it remembers too long to be judged
        return
    assert held.why_refused


def test_shuffled_rows_would_have_flattered_it() -> None:
    """The published figure is of training data. By rows drawn by lot this residual, which nothing explains, seems learned."""
    table = table_of(wandering(1, 7200.0), (*PUBLISHED, *small_model(feature_set="remembering").model.features[8:]), 60.0)
    x, y = table.x, table.residual_k
    drawn = np.random.default_rng(0).random(len(y)) < 0.3
    by_lot = 1.0 - rmse(y[drawn] - fitted(x[~drawn], y[~drawn], SMALL).predict(x[drawn])) / rmse(y[drawn])
    itself = 1.0 - rmse(y - fitted(x, y, SMALL).predict(x)) / rmse(y)
    cut = int(0.7 * len(y))
    by_time = 1.0 - rmse(y[cut:] - fitted(x[: cut - 150], y[: cut - 150], SMALL).predict(x[cut:])) / rmse(y[cut:])
    assert by_lot > 0.4
    assert itself > 0.5
    assert by_time < 0.1


def test_an_offset_is_no_model() -> None:
    """A sensor that is 3 K off: the forest takes 97 % of the error away, and so does a constant."""
    noise = np.random.default_rng(2).normal(0.0, 0.3, len(recorded().t_s))
    held = trained(with_residual(recorded(), 3.0 + noise), QUICK, Trained()).model.held_out
    assert held.gain.low > 0.8
    assert "gain over a constant" in held.why_refused


def test_work_that_was_never_trained_on_gives_no_model() -> None:
    whole, done = recorded(), small_model()
    later = whole.t_s >= done.table.t_s[done.split.test[0]] - 1.0
    signals = {
        name: np.where(later, values + 100.0, values) if name == "ambient_temp_c" else values
        for name, values in whole.signals.items()
    }
    held = trained(Recorded(whole.t_s, whole.stretch, signals), QUICK, Trained()).model.held_out
    assert held.in_region == 0.0
    assert "is in the region of the training" in held.why_refused


def test_the_same_recording_and_seed_give_the_same_model() -> None:
    first, again = small_model(), trained(recorded(), replace(SMALL, seed=1), small_model().model.trained)
    assert dict(first.model.files) == dict(again.model.files)


def test_the_worth_of_a_feature_is_measured_on_held_out_time() -> None:
    held = small_model().model.held_out
    assert max(held.importance.values()) > 20.0 * abs(held.importance["ambient_temp_c"])
    assert list(held.importance.values()) == sorted(held.importance.values(), reverse=True)
    assert set(held.importance) == {str(one) for one in small_model().model.features}
