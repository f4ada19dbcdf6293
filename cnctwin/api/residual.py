"""Residual models: what the physics gets wrong, learned; used only inside the region that a model was trained on."""

import shlex
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cnctwin.api.answers import Part
from cnctwin.api.constants import OfMachine
from cnctwin.api.prediction import Plan
from twin.errors import TwinError
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from twin.residual.model import ResidualModel

FRESH_S = 30.0
STEPS_MAX = 20_000  # a step costs tens of microseconds
EXTRA = "pip install 'cnctwin[twin]' brings it"


class Correction(NamedTuple):
    """A model's correction of the physics, °C, and which model that is; None, or None for a step, with why not in `basis`."""

    temp_c: list[float | None] | None
    basis: str


class Models:
    """The current models of a folder, read again when they are half a minute old. Threads may share it."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._read_s = float("-inf")
        self._models: Mapping[str, ResidualModel] = {}
        self._trouble = ""

    def current(self) -> "tuple[Mapping[str, ResidualModel], str]":
        """The models by machine, and in one line what is wrong ('' = nothing)."""
        with self._lock:
            if self.folder is not None and time.monotonic() - self._read_s > FRESH_S:
                self._models, self._trouble = _read(self.folder)
                self._read_s = time.monotonic()
            return self._models, self._trouble

    def corrected(self, of: OfMachine, plan: Plan, physics_c: Sequence[float]) -> Correction:
        """The temperatures of a course with what was learned of its machine."""
        if self.folder is None:
            return Correction(None, "none: no folder of models was named")
        models, trouble = self.current()
        model = models.get(plan.machine)
        if model is None:
            return Correction(None, f"none: {trouble or f'no model of {plan.machine!r} is in the folder'}")
        from twin.residual.physics import Physics  # noqa: PLC0415  where there are models

        if not model.trained.physics.is_as(Physics.of(of.thermal.machine)):
            return Correction(None, f"none: {model.version} corrects another heat of the spindle; train it again")
        if len(physics_c) > STEPS_MAX:
            return Correction(None, f"none: a course of {len(physics_c)} steps is longer than the {STEPS_MAX} that are corrected")
        from twin.residual.prediction import predict_correction  # noqa: PLC0415  with the extra that it needs

        try:
            found = predict_correction(model, {**plan.signals(), twin_signals.SPINDLE_TEMP_C: physics_c}, plan.dt_s)
        except TwinError as error:
            return Correction(None, f"none: {error}")
        temp_c = [
            None if one.correction_k is None else round(physics + one.correction_k, 4)
            for physics, one in zip(physics_c, found, strict=True)
        ]
        outside = next((one.reason for one in found if one.correction_k is None), None)
        return Correction(temp_c, model.in_words if outside is None else f"{model.in_words}; null where {outside}")


def models_part(models: Models) -> Part:
    """Return the state of the models."""
    folder = models.folder
    if folder is None:
        line = "no folder of models: predictions are the physics alone"
        return Part(part="models", state="missing", reason=line, do="cnctwin train residual, and cnctwin serve --models DIR")
    found, trouble = models.current()
    if trouble or not found:
        line = f"{trouble or f'{folder} holds no model'}: predictions are the physics alone"
        return Part(part="models", state="missing", reason=line, do=f"cnctwin train residual --out {shlex.quote(str(folder))}")
    return Part(part="models", state="ok", reason="; ".join(f"{name}: {model.version}" for name, model in found.items()))


def _read(folder: Path) -> "tuple[dict[str, Any], str]":
    try:
        from twin.residual.model import load_models  # noqa: PLC0415  with the extra that it needs

        return load_models(folder), ""
    except ModuleNotFoundError as missing:
        return {}, f"models need the package {missing.name}; {EXTRA}"
    except (TwinError, OSError) as error:
        return {}, str(error)
