"""A regression forest in a folder by itself: arrays, and a manifest that names its features in order and what it predicts."""

from collections.abc import Sequence
from pathlib import Path

from twin.forest.artefact import ARRAYS, MANIFEST, digest, manifest_text, packed, read_arrays, read_manifest, write_folder
from twin.forest.errors import ForestError
from twin.forest.forest import forest_of_arrays
from twin.forest.regression import RegressionForest

KIND, VERSION = "regression forest", 1


def save_regression(model: RegressionForest, folder: Path, features: Sequence[str], target: str) -> None:
    """Writes the forest, the names of its features in their order, and of what it predicts. Raises ForestError."""
    if len(features) != model.forest.features:
        raise ForestError(f"{len(features)} names for {model.forest.features} features: name each, in the order of training")
    arrays = packed(model.forest.arrays())
    about = {"features": list(features), "target": target, "trees": model.forest.trees, "arrays_sha256": digest(arrays)}
    manifest = manifest_text({"kind": KIND, "version": VERSION, **about})
    write_folder(folder, {MANIFEST: manifest.encode(), ARRAYS: arrays})


def load_regression(folder: Path, features: Sequence[str]) -> RegressionForest:
    """The forest in a folder, for features in this order. Raises ForestError where it has others, or was damaged."""
    manifest = read_manifest(folder, KIND, VERSION)
    if (own := manifest.get("features")) != list(features):
        raise ForestError(f"{folder}: the forest's features are {own}, asked for are {list(features)}: give them in its order")
    return RegressionForest(forest_of_arrays(read_arrays(folder / ARRAYS, str(manifest.get("arrays_sha256")))))
