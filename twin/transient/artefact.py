"""A detector in a folder: arrays.npz with the template, manifest.json with all else and the checksum of the arrays. No pickle."""

import hashlib
import io
import json
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.transient.detector import FEATURES, Detector, Limits
from twin.transient.errors import TransientError
from twin.transient.evidence import Weighing
from twin.transient.level import SIGNALS
from twin.transient.template import STRETCHES, Template
from twin.transient.training import Trained

KIND: Final = "cnctwin tool-change detector"
VERSION: Final = 1
ARRAYS, MANIFEST = "arrays.npz", "manifest.json"
BYTES_MAX = 10_000_000
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=-1.0, le=1.0)]


class Record(BaseModel):
    """A part of the manifest."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Thresholds(Record):
    """As `twin.transient.detector.Limits`."""

    start_rho: Share
    end_rho: Share
    pattern_score: Share
    distance_max: Positive
    deviation_min: Positive
    deviation_max: Positive


class Weights(Record):
    """As `twin.transient.evidence.Weighing`, by feature."""

    names: tuple[str, ...]
    typical: tuple[Finite | None, ...]
    centres: tuple[Finite, ...]
    spreads: tuple[Positive, ...]
    weights: tuple[Finite, ...]
    bias: Finite


class FalseGates(Record):
    """False gates a day by the signal alone, with the 90 % interval, and what that rests on (`twin.transient.extremes`)."""

    per_day: Finite
    low: Finite
    high: Finite
    null_hours: Finite
    peaks: int
    seen: int
    is_extrapolated: bool


class Training(Record):
    """The training of a detector. asked_score: the threshold for the rate that was asked for; None = too little null to say."""

    runs: tuple[str, ...] = ()
    versions: dict[str, str] = {}
    changes: int
    captured: int
    confirmed: int
    false_gates_per_day_asked: Finite
    asked_score: Finite | None
    false_gates: FalseGates
    provisional_per_day: Finite
    weighed_peaks: int | None
    copies_found: Finite


class Manifest(Record):
    """The file."""

    kind: Literal["cnctwin tool-change detector"]
    version: Literal[1]
    signal: Literal["spindle_rpm", "spindle_current_a", "spindle_load_pct"]
    period_s: Positive
    stall_s: Annotated[float, Field(ge=0.0, le=600.0)]
    scale: Positive
    limits: Thresholds
    weighing: Weights | None
    training: Training | None
    arrays_sha256: str


def save_detector(folder: Path, trained: Trained, runs: tuple[str, ...], versions: dict[str, str], asked_per_day: float) -> None:
    """Write what was trained into a folder, which is made if need be. Raises OSError where it cannot be written."""
    detector, rate = trained.detector, trained.rate
    template, weighing = detector.template, detector.weighing
    signal: Any = detector.signal
    buffer = io.BytesIO()
    np.savez(buffer, start=template.start, between=template.between, end=template.end, stretches=np.array(template.stretches))
    arrays = buffer.getvalue()
    limits = {name: getattr(detector.limits, name) for name in Thresholds.model_fields}
    manifest = Manifest(
        kind=KIND,
        version=VERSION,
        signal=signal,
        period_s=template.period_s,
        stall_s=template.stall_s,
        scale=detector.scale,
        limits=Thresholds(**limits),
        weighing=None if weighing is None else Weights(**{name: getattr(weighing, name) for name in Weights.model_fields}),
        training=Training(
            runs=runs,
            versions=versions,
            changes=trained.changes,
            captured=len(trained.captured),
            confirmed=trained.confirmed,
            false_gates_per_day_asked=asked_per_day,
            asked_score=trained.asked_score,
            false_gates=FalseGates(**{name: getattr(rate, name) for name in FalseGates.model_fields}),
            provisional_per_day=trained.provisional_per_day,
            weighed_peaks=trained.weighed_peaks,
            copies_found=trained.copies_found,
        ),
        arrays_sha256=hashlib.sha256(arrays).hexdigest(),
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ARRAYS).write_bytes(arrays)
    (folder / MANIFEST).write_text(json.dumps(manifest.model_dump(mode="json"), indent=2) + "\n", encoding="utf-8")


def load_detector(folder: Path) -> tuple[Detector, str]:
    """The detector in a folder, and the checksum of its manifest, by which one is told from another.

    Raises TransientError where there is none, or one part does not belong to the other.
    """
    try:
        said = (folder / MANIFEST).read_bytes()
        if (folder / ARRAYS).stat().st_size > BYTES_MAX:
            raise TransientError(f"{folder / ARRAYS} is larger than {BYTES_MAX} bytes: it is no template")
        arrays = (folder / ARRAYS).read_bytes()
    except OSError as error:
        raise TransientError(
            f"{folder}: no detector can be read here ({error.strerror or error}); make one with `cnctwin train detector`"
        ) from None
    try:
        manifest = Manifest.model_validate_json(said)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise TransientError(f"{folder / MANIFEST}: {where}: {first['msg']}; train it again with this version") from None
    if hashlib.sha256(arrays).hexdigest() != manifest.arrays_sha256:
        raise TransientError(f"{folder / ARRAYS} is not the file that {MANIFEST} was written for; copy both, or train it again")
    return _detector(folder, manifest, arrays), hashlib.sha256(said).hexdigest()[:16]


def _detector(folder: Path, manifest: Manifest, arrays: bytes) -> Detector:
    assert manifest.signal in SIGNALS
    with np.load(io.BytesIO(arrays), allow_pickle=False) as held:
        if (size := sum(member.file_size for member in held.zip.infolist())) > BYTES_MAX:  # before it is unpacked
            raise TransientError(f"{folder / ARRAYS} unpacks to {size} bytes, more than {BYTES_MAX}: it is no template")
        parts = {name: np.asarray(held[name], dtype=np.float64) for name in ("start", "between", "end", "stretches")}
    if any(part.ndim != 1 or not np.isfinite(part).all() for part in parts.values()):
        raise TransientError(f"{folder / ARRAYS} holds what is no template; train it again")
    if not len(parts["stretches"]) or len(parts["stretches"]) > 4 * len(STRETCHES):
        raise TransientError(f"{folder / ARRAYS} holds {len(parts['stretches'])} stretches; train it again")
    weighing = None
    if manifest.weighing is not None:
        if manifest.weighing.names != FEATURES:
            raise TransientError(f"{folder / MANIFEST}: weighs {manifest.weighing.names}, not {FEATURES}; train it again")
        weighing = Weighing(**manifest.weighing.model_dump())
    stretches = tuple(map(float, parts["stretches"]))
    template = Template(manifest.period_s, parts["start"], parts["between"], parts["end"], manifest.stall_s, stretches)
    limits = Limits(**manifest.limits.model_dump())
    return Detector(manifest.signal, template, manifest.scale, limits, weighing)
