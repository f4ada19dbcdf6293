"""An anomaly model: which signals it looks at, how unusual a row of them is, and what its threshold rests on.

One scale for all detectors, 0 = as unusual as the contamination share of the training rows, larger = worse: −decision_function of
scikit-learn, decision_function of PyOD's IForest, decision_function − threshold_ of PyOD's others. In a folder it is

    manifest.json   features in their order, detector, training window, versions of libraries, calibration, checksums
    arrays.npz      the flattened forest; of other detectors the rows to train them on again, and rows with their scores
    parts.json      in its place, of a model that compares parts with parts
    golden.npz      the golden week (twin/anomaly/golden.py), where there is one

and the models of several machines stand in a folder as <machine>/current (twin/anomaly/store.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from twin.anomaly.calibration import Calibration
from twin.anomaly.errors import ModelError
from twin.anomaly.golden import GoldenWeek, golden_of_arrays
from twin.anomaly.manifest import KIND, UNSAID, VERSION, Flat, Manifest, Parts, Refit, Trained
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts_scorer import PARTS, PartsScorer, parts_text, read_parts
from twin.anomaly.preparation import Preparation
from twin.anomaly.refit import RefitScorer, again
from twin.forest.artefact import ARRAYS, MANIFEST, digest, manifest_text, packed, read_arrays, read_manifest, write_folder
from twin.forest.errors import ForestError
from twin.forest.forest import forest_of_arrays
from twin.forest.isolation import IsolationScorer

__all__ = ["CURRENT", "AnomalyModel", "Calibration", "Trained", "load_golden", "load_model", "load_models", "save_model"]

CURRENT, GOLDEN = "current", "golden.npz"
MACHINES_MAX = 10_000
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class AnomalyModel:
    """features: canonical signals, in the order of the row; calibration: None where no threshold was fitted
    preparation: None where rows are scored as they are; else what is scored is `Standardised.values`, in the same order
    """

    features: tuple[str, ...]
    scorer: IsolationScorer | RefitScorer | PartsScorer
    trained: Trained = UNSAID
    calibration: Calibration | None = None
    preparation: Preparation | None = None

    def score_one(self, values: Sequence[float]) -> float:
        """Return how unusual one row is: 0 = at the contamination share of training, larger = worse.

        Raises TwinError where it has not one finite number for each feature, or parts are compared, where a row has no score.
        """
        return self.scorer.score_one(values)

    def scores(self, rows: Floats) -> Floats:
        """The scores (n,) of rows (n, features), the same as one by one."""
        return self.scorer.scores(rows)

    def calibrated(self, calibration: Calibration | None) -> "AnomalyModel":
        """The same model with this threshold."""
        return replace(self, calibration=calibration)

    @property
    def parts(self) -> PartsModel | None:
        """The usual values at each moment of a part; None where a row is scored by itself."""
        return self.scorer.model if isinstance(self.scorer, PartsScorer) else None

    @property
    def parts_id(self) -> str:
        """The first digits of the checksum of `parts`; "" = there are none."""
        return self.scorer.sha256[:12] if isinstance(self.scorer, PartsScorer) else ""

    @property
    def in_words(self) -> str:
        """Describe the model in one line."""
        scorer = self.scorer
        if isinstance(scorer, PartsScorer):
            name = "parts beside parts"
        else:
            name = (
                f"isolation forest of {scorer.forest.trees} trees" if isinstance(scorer, IsolationScorer) else scorer.about.name
            )
        when = f", trained {self.trained.at}" if self.trained.at else ", trained"
        return f"{name} on {', '.join(self.features)}{when} on {self.trained.rows} rows"


def files_of(model: AnomalyModel, golden: GoldenWeek | None = None) -> dict[str, bytes]:
    """Return the files of a model's folder; the same model gives the same bytes."""
    scorer = model.scorer
    if isinstance(scorer, IsolationScorer):
        detector: Flat | Refit | Parts = Flat(denominator=scorer.denominator, offset=scorer.offset)
        file, arrays = ARRAYS, packed(scorer.forest.arrays())
    elif isinstance(scorer, PartsScorer):
        detector, file, arrays = Parts(), PARTS, parts_text(scorer.model)
    else:
        detector, file, arrays = scorer.about, ARRAYS, packed(scorer.arrays())
    week = None if golden is None else packed(golden.arrays())
    manifest = Manifest(
        kind=KIND,
        version=VERSION,
        features=model.features,
        detector=detector,
        trained=model.trained,
        calibration=model.calibration,
        preparation=model.preparation,
        arrays_sha256=digest(arrays),
        golden_sha256=None if week is None else digest(week),
    )
    files = {MANIFEST: manifest_text(manifest.model_dump(mode="json")).encode(), file: arrays}
    return files if week is None else {**files, GOLDEN: week}


def save_model(model: AnomalyModel, folder: Path, golden: GoldenWeek | None = None) -> None:
    """Writes the model into a folder, in one move. Raises ModelError where it cannot be written."""
    try:
        write_folder(folder, files_of(model, golden))
    except ForestError as error:
        raise ModelError(str(error)) from None


def load_model(folder: Path) -> AnomalyModel:
    """The model in a folder, or in its `current`. Raises ModelError where there is none, or it is not whole."""
    folder = _folder(folder)
    manifest = _manifest(folder)
    try:
        if isinstance(manifest.detector, Parts):
            return _of_parts(folder, manifest)
        arrays = read_arrays(folder / ARRAYS, manifest.arrays_sha256)
        if isinstance(manifest.detector, Flat):
            forest = forest_of_arrays(arrays)
            width = forest.features
            scorer: IsolationScorer | RefitScorer | PartsScorer = IsolationScorer(
                forest, manifest.detector.denominator, manifest.detector.offset
            )
            scorer.score_one(forest.scaling[0])  # compiles the kernel or fetches it, so that the first row need not wait
        else:
            scorer = again(manifest.detector, arrays)
            width = scorer.rows.shape[1]
    except (ForestError, ModelError) as error:
        text = str(error)
        raise ModelError(text if text.startswith(str(folder)) else f"{folder}: {text}") from None
    prepared = manifest.features if manifest.preparation is None else manifest.preparation.signals
    if width != len(manifest.features) or prepared != manifest.features:
        raise ModelError(f"{folder}: {MANIFEST} names {len(manifest.features)} features, the arrays have {width}: train again")
    return AnomalyModel(manifest.features, scorer, manifest.trained, manifest.calibration, manifest.preparation)


def _of_parts(folder: Path, manifest: Manifest) -> AnomalyModel:
    model = read_parts(folder / PARTS, manifest.arrays_sha256)
    if model.signals != manifest.features:
        raise ModelError(f"{folder}: {MANIFEST} names {manifest.features}, {PARTS} has {model.signals}: train again")
    return AnomalyModel(manifest.features, PartsScorer(model), manifest.trained, manifest.calibration)


def load_golden(folder: Path) -> GoldenWeek | None:
    """The golden week of the model in a folder; None where none was frozen. Raises ModelError where it is not whole."""
    folder = _folder(folder)
    manifest = _manifest(folder)
    if manifest.golden_sha256 is None:
        return None
    try:
        return golden_of_arrays(read_arrays(folder / GOLDEN, manifest.golden_sha256), manifest.features)
    except ForestError as error:
        raise ModelError(str(error)) from None


def load_models(folder: Path) -> dict[str, AnomalyModel]:
    """The current model of each machine in a folder, by the machine's name. Raises ModelError where one cannot be used."""
    if not folder.is_dir():
        raise ModelError(f"{folder}: there is no such folder with models; cnctwin train anomaly --out makes one")
    machines = sorted(path.parent for path in folder.glob(f"*/{CURRENT}"))
    if not machines or len(machines) > MACHINES_MAX:
        raise ModelError(f"{folder}: holds {len(machines)} models, as <machine>/{CURRENT}; 1 to {MACHINES_MAX} are needed")
    return {machine.name: load_model(machine) for machine in machines}


def _folder(folder: Path) -> Path:
    return folder / CURRENT if not (folder / MANIFEST).exists() and (folder / CURRENT).exists() else folder


def _manifest(folder: Path) -> Manifest:
    try:
        return Manifest.model_validate(read_manifest(folder, KIND, VERSION))
    except ForestError as error:
        raise ModelError(str(error)) from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ModelError(f"{folder / MANIFEST}: {place}: {first['msg']}") from None
