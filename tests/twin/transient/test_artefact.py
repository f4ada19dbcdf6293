"""A detector goes to files and back; what does not belong together is one clear error."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import synthetic_changes as drive
from tests.twin.transient.synthetic import small
from twin.transient.artefact import ARRAYS, MANIFEST, load_detector, save_detector
from twin.transient.errors import TransientError
from twin.transient.replay import replayed


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_detector(tmp_path / "model", small(), ("a.parquet",), {"numpy": np.__version__}, 1.0)
    return tmp_path / "model"


def test_what_is_loaded_finds_the_same(folder: Path) -> None:
    stream = drive.stream_of_changes(4, 10.0, np.random.default_rng(1), stretched=True, stalled=True)
    loaded, _ = load_detector(folder)
    assert replayed(loaded, stream).confirmed == replayed(small().detector, stream).confirmed != ()


def test_the_manifest_says_what_it_rests_on(folder: Path) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    assert manifest["training"]["runs"] == ["a.parquet"]
    assert set(manifest["training"]["false_gates"]) >= {"per_day", "low", "high", "null_hours", "is_extrapolated"}
    assert len(manifest["arrays_sha256"]) == 64


def test_saving_again_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    save_detector(tmp_path / "again", small(), ("a.parquet",), {"numpy": np.__version__}, 1.0)
    assert [(tmp_path / "again" / name).read_bytes() for name in (ARRAYS, MANIFEST)] == [
        (folder / name).read_bytes() for name in (ARRAYS, MANIFEST)
    ]


def test_arrays_of_another_model_are_refused(folder: Path) -> None:
    np.savez(folder / ARRAYS, start=np.ones(3))
    with pytest.raises(TransientError, match="is not the file"):
        load_detector(folder)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 2}, "version"),
        ({"kind": "anomaly"}, "kind"),
        ({"signal": "feed"}, "signal"),
        ({"more": 1}, "more"),
        ({"period_s": float("nan")}, "period_s"),
        ({"period_s": 0.0001}, "sample coarser"),
    ],
    ids=str,
)
def test_a_manifest_of_another_form_is_refused(folder: Path, change: dict[str, object], words: str) -> None:
    path = folder / MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(TransientError, match=words):
        load_detector(folder)
        if "period_s" in change:
            load_detector(folder)[0].template.bank  # noqa: B018


def test_a_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TransientError, match="cnctwin train detector"):
        load_detector(tmp_path)
