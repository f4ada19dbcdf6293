"""The registry: what stands where, what counts, and what is never deleted."""

import json
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.models import registry
from cnctwin.models.card import card_of, faults_of
from cnctwin.models.registry import Shelf
from cnctwin.standins.simulated_machine.description import ANOMALY_MODEL
from tests.cnctwin.models.made_model import made_model
from twin.anomaly import store as link_store
from twin.anomaly.model import load_models
from twin.models.pointer import resolve

NOW_S = 1_795_000_000.0
HOUR_S = 3600.0


@pytest.fixture
def own(tmp_path: Path) -> Shelf:
    """Three versions, the first of which counts."""
    for seed in (1, 2, 3):
        registry.add(tmp_path / "models", "residual", "vmc", made_model(tmp_path / f"trained-{seed}", seed), NOW_S + seed)
    return registry.shelf(tmp_path / "models", "residual", "vmc")


def champion(own: Shelf) -> str:
    pointer = own.pointer()
    assert pointer is not None
    return pointer.champion


def by_seed(own: Shelf) -> dict[int, str]:
    return {own.card(version).seed or 0: version for version in own.versions()}


def test_the_first_model_counts_and_the_next_ones_wait(own: Shelf) -> None:
    assert champion(own) == by_seed(own)[1]
    assert len(own.versions()) == 3


def test_the_same_model_added_again_is_the_same_version(own: Shelf, tmp_path: Path) -> None:
    version = registry.add(own.models, "residual", "vmc", tmp_path / "trained-2", NOW_S)
    assert version == by_seed(own)[2] and len(own.versions()) == 3


def test_a_card_says_what_it_was_trained_on_and_with_what(own: Shelf) -> None:
    card = own.card(by_seed(own)[2])
    assert (card.from_, card.to, card.data_sha256) == ("2026-11-01T00:00:00Z", "2026-11-10T00:00:00Z", "d" * 64)
    assert card.features == ("spindle_rpm~600", "ambient_temp_c") and card.seed == 2
    assert card.held_out == {"hours": 48.0, "gain.value": 0.41, "gain.low": 0.3, "gain.high": 0.5}
    assert card.code_version.startswith("cnctwin ") and set(card.files) == {"arrays.npz", "manifest.json"}


def test_what_was_promoted_counts_by_pointer_and_by_link_and_the_one_before_stays_warm_for_48_hours(own: Shelf) -> None:
    seeds = by_seed(own)
    registry.promoted(own, seeds[2], "it won", NOW_S)
    assert resolve(own.folder, (own.folder / "current.json").read_text()) == own.folder / seeds[2]
    assert (own.folder / "current").resolve() == (own.folder / seeds[2]).resolve()
    assert own.warm(NOW_S + 47.9 * HOUR_S) == own.folder / seeds[1]
    assert own.warm(NOW_S + 48.1 * HOUR_S) is None


def test_the_way_back_is_one_step_and_there_is_a_way_forth_again(own: Shelf) -> None:
    seeds = by_seed(own)
    with pytest.raises(UsageError, match="there was no champion before"):
        registry.rolled_back(own, "", NOW_S)
    registry.promoted(own, seeds[2], "", NOW_S)
    assert registry.rolled_back(own, "it was worse", NOW_S + 1).champion == seeds[1]
    assert champion(own) == seeds[1] and own.warm(NOW_S + 2) == own.folder / seeds[2]
    assert registry.rolled_back(own, "it was not", NOW_S + 3).champion == seeds[2]


def test_a_model_whose_files_have_changed_is_not_promoted(own: Shelf) -> None:
    folder = own.folder / by_seed(own)[2]
    (folder / "arrays.npz").write_bytes(b"other")
    (folder / "more.npz").write_bytes(b"more")
    assert faults_of(folder) == ["arrays.npz: is not what it was", "more.npz: was not there"]
    with pytest.raises(UsageError, match=r"arrays\.npz: is not what it was"):
        registry.promoted(own, folder.name, "", NOW_S)
    assert champion(own) == by_seed(own)[1]


def test_nothing_that_counts_is_warm_or_golden_is_ever_deleted(own: Shelf, tmp_path: Path) -> None:
    seeds = by_seed(own)
    registry.promoted(own, seeds[2], "", NOW_S)
    (own.folder / "golden").mkdir()
    (own.folder / "golden" / "golden.json").write_text("{}")
    newer = [registry.add(own.models, "residual", "vmc", made_model(tmp_path / f"t{n}", n), NOW_S + n) for n in (4, 5)]
    assert registry.pruned(own, 1, NOW_S + HOUR_S) == [seeds[3], newer[0]]
    assert set(own.versions()) == {seeds[1], seeds[2], newer[1]}
    assert registry.pruned(own, 1, NOW_S + 49 * HOUR_S) == [seeds[1]]
    assert (own.folder / "golden" / "golden.json").exists()


def test_a_version_is_named_by_digits_that_only_one_begins_with(own: Shelf) -> None:
    version = own.versions()[0]
    assert own.named(version[:6]).name == version
    for none in ("", "zz"):
        with pytest.raises(UsageError, match="versions begin with"):
            own.named(none)


@pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "a\\b", "x" * 201])
def test_a_machine_or_kind_that_is_no_folder_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot name a folder"):
        registry.shelf(tmp_path, "residual", name)
    with pytest.raises(UsageError, match="cannot name a folder"):
        registry.shelf(tmp_path, name, "vmc")


def test_a_kind_that_the_manifest_does_not_say_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="kept under residual, not anomaly"):
        registry.add(tmp_path / "models", "anomaly", "vmc", made_model(tmp_path / "m"), NOW_S)
    with pytest.raises(UsageError, match=r"holds no manifest\.json"):
        registry.add(tmp_path / "models", "anomaly", "vmc", tmp_path, NOW_S)


def test_a_damaged_pointer_is_said_and_promoting_is_the_way_out(own: Shelf) -> None:
    (own.folder / "current.json").write_text("{")
    with pytest.raises(UsageError, match=r"is not JSON.*; cnctwin model promote writes it again"):
        own.pointer()
    registry.promoted(own, by_seed(own)[3], "", NOW_S)
    assert champion(own) == by_seed(own)[3]


def test_the_anomaly_processor_reads_the_registry_as_it_reads_what_training_wrote(tmp_path: Path) -> None:
    version = registry.add(tmp_path, "anomaly", "vmc", ANOMALY_MODEL, NOW_S)
    assert set(load_models(tmp_path / "anomaly")) == {"vmc"}
    card = card_of(tmp_path / "anomaly" / "vmc" / version, "anomaly", "vmc")
    assert card.features[0] == "spindle_load_pct" and card.held_out["alerts_per_week"] == 1.0


def test_a_link_that_was_turned_by_train_promote_is_right(tmp_path: Path) -> None:
    first = registry.add(tmp_path, "anomaly", "vmc", ANOMALY_MODEL, NOW_S)
    other = tmp_path / "other"
    other.mkdir()
    for path in ANOMALY_MODEL.iterdir():
        (other / path.name).write_bytes(path.read_bytes())
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["trained"]["at"] = "2026-11-22T00:00:00+00:00"
    (other / "manifest.json").write_text(json.dumps(manifest))
    second = registry.add(tmp_path, "anomaly", "vmc", other, NOW_S)
    own = registry.shelf(tmp_path, "anomaly", "vmc")
    assert champion(own) == first
    link_store.promote(tmp_path / "anomaly", "vmc", second)
    pointer = own.pointer()
    assert pointer is not None and (pointer.champion, pointer.previous) == (second, first)
    assert registry.rolled_back(own, "", NOW_S).champion == first
    assert link_store.current_of(tmp_path / "anomaly", "vmc") == first
