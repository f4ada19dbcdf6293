"""manifest.json of an anomaly model."""

from typing import Annotated, Literal

from pydantic import Field

from twin.anomaly.calibration import Calibration, Finite, Record
from twin.anomaly.preparation import Preparation

KIND, VERSION = "cnctwin anomaly model", 1


class Trained(Record):
    """The data and time that a model was trained on.

    at: UTC, as ISO 8601; source: files or database; from_s, to_s: window on the clock of the source; versions: of the libraries
    """

    machine: str = ""
    at: str = ""
    source: tuple[str, ...] = ()
    from_s: Finite = 0.0
    to_s: Finite = 0.0
    rows: int = Field(default=0, ge=0)
    versions: dict[str, str] = Field(default_factory=dict)


UNSAID = Trained()


class Flat(Record):
    """An isolation forest, whose arrays are in the file (twin/forest/forest.py)."""

    kind: Literal["isolation_forest"] = "isolation_forest"
    denominator: Finite
    offset: Finite


class Refit(Record):
    """A detector of PyOD that is trained again when it is loaded, on the rows in the file.

    center: its threshold_, which is taken from its scores
    """

    kind: Literal["pyod"] = "pyod"
    name: str
    parameters: dict[str, bool | int | float | str | None] = Field(default_factory=dict)
    seed: int = 0
    center: Finite = 0.0


class Parts(Record):
    """The usual values at each moment of a part, which are in the file `parts.json` (twin/anomaly/parts/model.py)."""

    kind: Literal["parts"] = "parts"


class Manifest(Record):
    """The file.

    arrays_sha256: of the file that the detector needs, which is parts.json for `parts` and arrays.npz for the others
    """

    kind: str
    version: int
    features: tuple[str, ...] = Field(min_length=1)
    detector: Annotated[Flat | Refit | Parts, Field(discriminator="kind")]
    trained: Trained
    calibration: Calibration | None
    preparation: Preparation | None = None
    arrays_sha256: str
    golden_sha256: str | None = None
