"""What a challenger has to show, and what becomes of it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from cnctwin.challenge import losses
from cnctwin.challenge.contest import Losses, outcome
from cnctwin.challenge.stretch import read_stretch, stretch_of_store
from cnctwin.commands.learn.model import model_app
from cnctwin.errors import ApplicationError, UsageError
from cnctwin.memory.store.opening import open_store
from cnctwin.models import golden, registry
from cnctwin.models.golden import freeze, golden_of
from cnctwin.models.registry import Shelf
from cnctwin.standins.simulated_machine.description import ANOMALY_MODEL
from tests.cnctwin.models.made_model import made_model
from tests.cnctwin.validation.made_night import START_S, warm_night
from tests.cnctwin.validation.stored_night import stored, told
from tests.twin.residual.days import PHYSICS_TOLD, SMALL, recorded
from twin.residual.model import Trained, load_model, save_model
from twin.residual.training import trained
from twin.runlog import RunLog, run_log, write_run

NOW_S = 1_795_000_000.0
DAY_ROWS = 8640


def correlated(seed: int, rows: int = DAY_ROWS, memory: float = 0.98) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Errors of a model over a day, a row each ten seconds, with a memory of some ten minutes."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -memory], np.random.default_rng(seed).standard_normal(rows))) * np.sqrt(1 - memory**2)


def test_a_challenger_that_is_as_good_seldom_wins() -> None:
    """Both off by errors of the same size; the difference has a mean of 0. benchmarks/validation.py counts 2000 of them."""
    wins = sum(
        outcome(Losses(correlated(seed) ** 2, correlated(10_000 + seed) ** 2, 10.0), None, hours_min=23.0).wins
        for seed in range(60)
    )
    assert wins <= 5


def test_a_challenger_that_is_better_by_a_fifth_wins_and_a_worse_one_does_not() -> None:
    shared = 0.5 + correlated(1) ** 2
    better, worse = Losses(shared, 0.8 * shared, 10.0), Losses(0.8 * shared, shared, 10.0)
    assert outcome(better, None, hours_min=23.0).wins
    lost = outcome(worse, None, hours_min=23.0)
    assert not lost.wins and lost.reason == "the challenger is worse on the holdout"


@pytest.mark.parametrize(
    ("holdout_rows", "golden_factor", "reason"),
    [
        (DAY_ROWS // 2, 1.0, "12 h were judged; 23 h are needed"),
        (DAY_ROWS, 1.06, "worse on the golden week by 6 %, 5 % are tolerated"),
    ],
)
def test_the_champion_stays_and_it_is_said_why(holdout_rows: int, golden_factor: float, reason: str) -> None:
    shared = 0.5 + correlated(1, holdout_rows) ** 2
    week = Losses(shared, golden_factor * shared, 10.0)
    found = outcome(Losses(shared, 0.8 * shared, 10.0), week, hours_min=23.0)
    assert not found.wins and reason in found.reason


def test_worse_on_the_golden_week_within_the_tolerance_still_wins() -> None:
    shared = 0.5 + correlated(1) ** 2
    found = outcome(Losses(shared, 0.8 * shared, 10.0), Losses(shared, 1.04 * shared, 10.0), hours_min=23.0)
    assert found.wins and found.golden_change_pct == pytest.approx(4.0)


def test_only_moments_at_which_both_can_be_judged_count() -> None:
    one, other = np.array([1.0, np.nan, 3.0]), np.array([np.nan, 2.0, 1.0])
    assert Losses(one, other, 10.0).means() == (3.0, 1.0)
    with pytest.raises(UsageError, match="no moment at which both models can be judged"):
        Losses(one[:2], other[:2], 10.0).means()


def by_quality(folder: Path, log: RunLog, _machine: str) -> tuple[Any, Any, float]:
    """A loss as large as the manifest's `quality`, on a day or a week alike, with what both find hard."""
    quality = json.loads((folder / "manifest.json").read_text())["quality"]
    rows = len(log)
    return log.t_s, quality * (0.5 + correlated(3, rows) ** 2), 10.0


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shelf:
    """A champion of quality 1, a challenger that is better, and one that is the same."""
    monkeypatch.setitem(losses.LOSSES, "residual", by_quality)
    monkeypatch.chdir(tmp_path)
    for seed, quality in ((1, 1.0), (2, 0.7), (3, 1.0)):
        folder = made_model(tmp_path / f"t{seed}", seed, quality=quality)
        registry.add(tmp_path / "models", "residual", "vmc", folder, NOW_S)
    write_run(day(), tmp_path / "day.parquet")
    return registry.shelf(tmp_path / "models", "residual", "vmc")


def day(at_s: float = 1_796_000_000.0, rows: int = DAY_ROWS + 1) -> RunLog:
    return run_log({"t_s": at_s + 10.0 * np.arange(rows), "spindle_temp_c": np.full(rows, 30.0)}, "day.parquet")


def seeded(own: Shelf, seed: int) -> str:
    return next(version for version in own.versions() if own.card(version).seed == seed)


def model(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(model_app, [*arguments, "--models", "models"])
    if isinstance(done.exception, ApplicationError):
        raise done.exception
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout


def test_a_challenger_that_wins_is_promoted_and_the_way_back_is_one_command(own: Shelf) -> None:
    champion, challenger = seeded(own, 1), seeded(own, 2)
    model("golden", "residual", "vmc", "--run", "day.parquet")
    code, text = model("compare", "residual", "vmc", challenger, "--runs", "day.parquet", "--promote", "--json")
    told = json.loads(text)
    assert code == 0 and told["wins"] is True and told["promoted"] is True and told["golden_change_pct"] == pytest.approx(-30.0)
    assert told["low"] > 0.0 and told["hours"] >= 24.0
    pointer = own.pointer()
    assert pointer is not None and (pointer.champion, pointer.previous) == (challenger, champion)
    assert "~" in model("list")[1]
    assert model("rollback", "residual", "vmc", "--because", "parts were bad")[0] == 0
    assert (own.pointer() or pointer).champion == champion
    assert json.loads(model("show", "residual", "vmc", challenger, "--json")[1])["comparisons"][0]["wins"] is True


def test_the_same_again_does_not_win_and_is_not_promoted_without_a_reason(own: Shelf) -> None:
    same = seeded(own, 3)
    code, text = model("compare", "residual", "vmc", same, "--runs", "day.parquet", "--promote")
    assert code == 1 and "does not win: the difference is none for sure" in text
    with pytest.raises(UsageError, match=r"has not won against .*: compare it, or give --why"):
        model("promote", "residual", "vmc", same)
    assert model("promote", "residual", "vmc", same, "--because", "the sensor was changed")[0] == 0
    pointer = own.pointer()
    assert pointer is not None and (pointer.champion, pointer.reason) == (same, "the sensor was changed")


def test_a_win_against_a_champion_of_the_past_is_none_against_the_present_one(own: Shelf) -> None:
    better = seeded(own, 2)
    assert model("compare", "residual", "vmc", better, "--runs", "day.parquet")[0] == 0
    model("promote", "residual", "vmc", better)
    model("promote", "residual", "vmc", seeded(own, 3), "--because", "a test")
    with pytest.raises(UsageError, match="has not won"):
        model("promote", "residual", "vmc", better)


def test_a_holdout_that_one_of_them_was_trained_on_is_refused(own: Shelf) -> None:
    write_run(day(at_s=1_793_600_000.0), Path("seen.parquet"))  # 2 November; trained from the 1st to the 10th
    with pytest.raises(UsageError, match=r"was trained from 2026-11-01.* and .*seen\.parquet lies in that"):
        model("compare", "residual", "vmc", seeded(own, 2), "--runs", "seen.parquet")


def test_what_cannot_be_compared_says_so(own: Shelf, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="is the champion"):
        model("compare", "residual", "vmc", seeded(own, 1), "--runs", "day.parquet")
    monkeypatch.delitem(losses.LOSSES, "residual")
    with pytest.raises(UsageError, match="models of kind residual are not compared"):
        model("compare", "residual", "vmc", seeded(own, 2), "--runs", "day.parquet")
    with pytest.raises(UsageError, match="no data is named"):
        model("compare", "residual", "vmc", seeded(own, 2))


def test_a_golden_week_is_what_was_frozen_or_none(own: Shelf) -> None:
    assert golden_of(own) is None
    told_of = freeze(own, day(), "a day", NOW_S)
    found = golden_of(own)
    assert found is not None and found[1]["sha256"] == told_of["sha256"]
    np.testing.assert_array_equal(found[0].t_s, day().t_s)
    path = own.folder / "golden" / str(told_of["file"])
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.raises(UsageError, match="is not what was frozen"):
        golden_of(own)
    path.unlink()
    with pytest.raises(UsageError, match="the golden week is gone"):
        golden_of(own)
    assert golden.MANIFEST == "golden.json" and own.versions() == registry.shelf(own.models, "residual", "vmc").versions()


def test_a_stretch_of_a_store_holds_what_models_look_at_and_survives_freezing(tmp_path: Path) -> None:
    night = warm_night(0.2)
    log = RunLog(
        night.t_s, {**night.columns, "axis_x_pos_mm": night["spindle_temp_c"]}, {"program": np.full(len(night), "O1", object)}
    )
    store = open_store(stored(tmp_path / "store", list(told(log, START_S))))
    found = stretch_of_store(store, "vmc", round(1000 * START_S), round(1000 * START_S) + 720_000, "the store")
    store.close()
    assert len(found) == 720 and found.t_s[0] == START_S
    assert found["spindle_temp_c"][100] == pytest.approx(night["spindle_temp_c"][100], abs=0.1)
    assert set(found.text["program"][1:]) == {"O1"}
    write_run(found, tmp_path / "frozen.parquet")
    again = read_stretch(tmp_path / "frozen.parquet")
    np.testing.assert_array_equal(again["axis_x_pos_mm"], found["axis_x_pos_mm"])


def test_an_anomaly_model_is_compared_by_its_false_alerts() -> None:
    night = warm_night(0.5)
    more = {"feed_mm_min": np.where(night["spindle_rpm"] > 0, 3000.0, 0.0), "tool_number": np.ones(len(night)),
            "feed_override_pct": np.full(len(night), 100.0)}  # fmt: skip
    log = RunLog(night.t_s, {**night.columns, **more}, {"program": np.full(len(night), "O1701", object)}, (), "night")
    found = losses.losses("anomaly", (ANOMALY_MODEL, ANOMALY_MODEL), log, "vmc")
    assert found.every_s == 1.0 and found.hours > 0.3
    np.testing.assert_array_equal(found.champion, found.challenger)
    assert set(np.unique(found.champion[np.isfinite(found.champion)])) <= {0.0, 1.0}


def test_real_residual_models_are_compared_on_days_unseen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A forest that may grow, against one of two stumps: the same machine, other days."""
    monkeypatch.chdir(tmp_path)
    other = recorded(60.0, seed=2)
    columns = {name: values for name, values in other.signals.items() if not name.startswith(("twin/", "axis_"))}
    write_run(run_log({"t_s": other.t_s, **columns}), tmp_path / "day.parquet")
    versions = []
    for asked in (replace(SMALL, depth_max=1, trees=2), SMALL):
        about = Trained(machine="vmc", physics=PHYSICS_TOLD, source=("other.parquet",))
        folder = save_model(trained(recorded(), replace(asked, feature_set="lean"), about).model, tmp_path / "trained")
        versions.append(registry.add(tmp_path / "models", "residual", "vmc", folder, NOW_S))
    code, text = model("compare", "residual", "vmc", versions[1], "--runs", "day.parquet", "--promote", "--json")
    told_of = json.loads(text)
    assert code == 0 and told_of["wins"] is True and told_of["challenger_loss"] < told_of["champion_loss"]
    pointer = registry.shelf(tmp_path / "models", "residual", "vmc").pointer()
    assert pointer is not None and pointer.champion == versions[1]
    assert load_model(tmp_path / "models" / "residual" / "vmc").version == versions[1]
