"""The scorer of a model that compares parts with parts, and its file `parts.json`, whose checksum stands in the manifest.

It has no score of a row alone: what a tick means depends on where it is in its part, and on the ticks and parts before it
(`twin/anomaly/parts/`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from pydantic import ValidationError

from twin.anomaly.errors import ModelError
from twin.anomaly.parts.model import PartsModel
from twin.forest.artefact import digest, read_file
from twin.forest.errors import ForestError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

PARTS = "parts.json"
NO_ROW = "parts are compared with parts, tick by tick: a row alone has no score"


@dataclass(frozen=True, eq=False)
class PartsScorer:
    """model: the usual values by operation and section"""

    model: PartsModel

    @cached_property
    def sha256(self) -> str:
        """The checksum of the file."""
        return digest(parts_text(self.model))

    def score_one(self, values: Sequence[float]) -> NoReturn:
        """Raise ModelError: a row alone has no score."""
        raise ModelError(NO_ROW)

    def scores(self, rows: "NDArray[np.float64]") -> NoReturn:
        """Raise ModelError: rows alone have no scores."""
        raise ModelError(NO_ROW)


def parts_text(model: PartsModel) -> bytes:
    """Return the file; the same model gives the same bytes."""
    return model.model_dump_json().encode()


def read_parts(path: Path, sha256: str) -> PartsModel:
    """Return the model in a file whose checksum is this. Raises ModelError where it is another, or no such model."""
    try:
        data = read_file(path)
    except ForestError as error:
        raise ModelError(str(error)) from None
    if digest(data) != sha256:
        raise ModelError(f"{path}: its SHA-256 is {digest(data)[:12]}…, the manifest says {sha256[:12]}…: copy the model again")
    try:
        return PartsModel.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ModelError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}: train it again") from None
