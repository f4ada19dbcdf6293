"""Random forest for regression: the mean of what its trees say (L. Breiman, "Random Forests", 2001)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from twin.forest.artefact import ARRAYS, MANIFEST, digest, manifest_text, packed, read_arrays, read_manifest, write_folder
from twin.forest.errors import ForestError
from twin.forest.forest import Forest, forest_of_arrays
from twin.forest.kernels import Floats

KIND, VERSION = "cnctwin regression forest", 1


@dataclass(frozen=True, slots=True, eq=False)
class RegressionForest:
    """Predicts one figure; scikit-learn's predict with n_jobs=1, to the last bit."""

    forest: Forest

    def predict_one(self, values: Sequence[float]) -> float:
        """The prediction for one row. Raises ForestError where it has not one finite number for each feature."""
        return self.forest.total_one(values) / self.forest.trees

    def predict(self, rows: Floats) -> Floats:
        """The predictions (n,) for rows (n, features)."""
        return self.forest.totals(rows) / self.forest.trees


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
