"""A residual model: features, forest, region, and what it did on held-out time. In a folder it is

    manifest.json   features in their order, training window, held-out figures, versions of libraries, checksum
    arrays.npz      the flattened forest (twin/forest/forest.py) and the region (twin/residual/region.py)

and its version is the first 12 digits of the SHA-256 of the manifest, in which the checksum of the arrays stands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from twin.anomaly.calibration import Finite, NotNegative, Record
from twin.forest.artefact import (
    ARRAYS,
    MANIFEST,
    digest,
    manifest_text,
    packed,
    read_arrays,
    read_file,
    read_manifest,
    write_folder,
)
from twin.forest.errors import ForestError
from twin.forest.forest import forest_of_arrays
from twin.forest.regression import RegressionForest
from twin.models.errors import PointerError
from twin.models.pointer import LINK, POINTER, resolve
from twin.residual.errors import ResidualError
from twin.residual.features import PHYSICS, Feature, feature
from twin.residual.held_out import HeldOut
from twin.residual.physics import Physics
from twin.residual.region import Region, region_of_arrays

KIND, VERSION = "cnctwin residual model", 1
FOLDER = "residual"
DIGITS = 12
MACHINES_MAX = 1000
REGION = "region_"


class Trained(Record):
    """The data and time that a model was trained on.

    at: UTC, ISO 8601; source: files or store; from_s, to_s: of the training rows, since 1970 (of run logs: since their start)
    hours: recorded; cutting_hours: of them; rows: trained on; physics: that is corrected; data_sha256: of the table of all rows
    """

    machine: str = ""
    at: str = ""
    source: tuple[str, ...] = ()
    from_s: Finite = Field(default=0.0, alias="from")
    to_s: Finite = Field(default=0.0, alias="to")
    hours: NotNegative = 0.0
    cutting_hours: NotNegative = 0.0
    rows: int = Field(default=0, ge=0)
    physics: Physics = Physics()
    data_sha256: str = ""
    feature_set: str = ""
    versions: Mapping[str, str] = {}


class _Manifest(Record):
    kind: str
    version: int
    features: tuple[str, ...] = Field(min_length=1)
    target: str
    trained: Trained
    held_out: HeldOut
    mean_residual_k: Finite
    seed: int = 0
    arrays_sha256: str


@dataclass(frozen=True, eq=False)
class ResidualModel:
    """mean_residual_k: of the training time; version: '' until it is saved or loaded"""

    features: tuple[Feature, ...]
    forest: RegressionForest
    region: Region
    trained: Trained
    held_out: HeldOut
    mean_residual_k: float = 0.0
    seed: int = 0

    def correction_one(self, row: Sequence[float]) -> float | str:
        """Return what is to be added to the physics, K; where the row is outside the region, why.

        Raises ForestError where it has not one finite number for each feature.
        """
        outside = self.region.outside(np.asarray(row, dtype=np.float64))
        if outside is None:
            return self.forest.predict_one(row)
        name = str(self.features[outside.feature])
        if outside.low is None or outside.high is None:
            return f"outside the region of training: nothing like it was there (furthest off: {name})"
        low, high = _shown(outside.low), _shown(outside.high)
        value = _shown(float(f"{outside.value:.2g}"))  # coarse: a reason that changes is published again
        return f"outside the region of training: {name} is about {value}, trained for {low} to {high}"

    @cached_property
    def files(self) -> Mapping[str, bytes]:
        """Return the files of its folder; the same model gives the same bytes."""
        arrays = packed({**self.forest.forest.arrays(), **{REGION + name: a for name, a in self.region.arrays().items()}})
        manifest = _Manifest(
            kind=KIND,
            version=VERSION,
            features=tuple(map(str, self.features)),
            target=f"spindle_temp_c - {PHYSICS}, K",
            trained=self.trained,
            held_out=self.held_out,
            mean_residual_k=self.mean_residual_k,
            seed=self.seed,
            arrays_sha256=digest(arrays),
        )
        return {MANIFEST: manifest_text(manifest.model_dump(mode="json", by_alias=True)).encode(), ARRAYS: arrays}

    @cached_property
    def version(self) -> str:
        """Names it."""
        return digest(self.files[MANIFEST])[:DIGITS]

    @property
    def in_words(self) -> str:
        """Describe the model in one line."""
        trained, held = self.trained, self.held_out
        return (
            f"model {self.version}: random forest of {self.forest.forest.trees} trees on {', '.join(map(str, self.features))}; "
            f"trained {trained.at} on {trained.hours:.0f} h; gain over the physics on {held.hours:.0f} h held out: {held.gain}"
        )


def save_model(model: ResidualModel, folder: Path) -> Path:
    """Writes the model into `<folder>/<version>`, which may be there already; that folder. Raises ResidualError."""
    own = folder / model.version
    if not (own / MANIFEST).exists():
        try:
            write_folder(own, model.files)
        except ForestError as error:
            raise ResidualError(str(error)) from None
    return own


def load_model(folder: Path) -> ResidualModel:
    """The model in a folder, or the current one of its versions. Raises ResidualError where none is there, or it is damaged."""
    folder = current_in(folder)
    try:
        raw = read_manifest(folder, KIND, VERSION)
        manifest = _Manifest.model_validate(raw)
        arrays = read_arrays(folder / ARRAYS, manifest.arrays_sha256)
        features = tuple(map(feature, manifest.features))
        forest = RegressionForest(forest_of_arrays({name: a for name, a in arrays.items() if not name.startswith(REGION)}))
        region = region_of_arrays(_region(arrays), len(features))
        if forest.forest.features != len(features):
            raise ResidualError(
                f"{MANIFEST} names {len(features)} features, the forest has {forest.forest.features}: train again"
            )
        model = ResidualModel(
            features, forest, region, manifest.trained, manifest.held_out, manifest.mean_residual_k, manifest.seed
        )
        model.__dict__["version"] = digest(read_file(folder / MANIFEST))[:DIGITS]
        # Compiles the kernels or fetches them, so that the first row need not wait.
        forest.predict_one(region.low.tolist())
        region.outside(0.5 * (region.low + region.high))
    except ValidationError as error:
        first = error.errors()[0]
        raise ResidualError(f"{folder / MANIFEST}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except (ForestError, ResidualError) as error:
        text = str(error)
        raise ResidualError(text if text.startswith(str(folder)) else f"{folder}: {text}") from None
    return model


def load_models(folder: Path) -> dict[str, ResidualModel]:
    """The current model of each machine, by its name, in a folder or its `residual`; {} where there is none.

    Raises ResidualError where one is damaged.
    """
    if (folder / FOLDER).is_dir():
        folder /= FOLDER
    there = {path.parent for name in (LINK, POINTER) for path in folder.glob(f"*/{name}")} if folder.is_dir() else set()
    if len(there) > MACHINES_MAX:
        raise ResidualError(f"{folder}: holds models of {len(there)} machines; {MACHINES_MAX} are the most")
    return {machine.name: load_model(machine) for machine in sorted(there)}


def current_in(folder: Path) -> Path:
    """The folder that holds a manifest: this one, what `current` links to, or the version that `current.json` names."""
    if (folder / MANIFEST).exists():
        return folder
    if (folder / LINK / MANIFEST).exists():
        return folder / LINK
    pointer = folder / POINTER
    if not pointer.exists():
        raise ResidualError(f"{folder}: no model is there; cnctwin train residual makes one")
    try:
        return resolve(folder, read_file(pointer).decode())
    except (ForestError, PointerError, ValueError) as error:
        raise ResidualError(str(error)) from None


def _region(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(REGION): array for name, array in arrays.items() if name.startswith(REGION)}


def _shown(value: float) -> str:
    """In so many digits as say something.

    >>> _shown(29_727.3), _shown(-0.0), _shown(21.456)
    ('29727', '0', '21.5')
    """
    return f"{value:.0f}" if 1000.0 <= abs(value) < 1e9 else f"{value + 0.0:.3g}"
