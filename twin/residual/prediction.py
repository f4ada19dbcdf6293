"""Corrections along a course that is given, as `/predict` of the runtime interface asks for them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from twin.residual.errors import ResidualError
from twin.residual.features import PHYSICS, Memory, row_after, signals_of
from twin.residual.model import ResidualModel


class Correction(NamedTuple):
    """The correction to be added to the physics, K; None, and why."""

    correction_k: float | None
    reason: str | None = None


def predict_correction(model: ResidualModel, signals: Mapping[str, Sequence[float]], dt_s: float) -> list[Correction]:
    """The correction at each sample of a course, `dt_s` apart, that begins with the physics' estimate.

    signals: canonical name → values of one length, with `twin/spindle_temp_c`, the physics. Where the model needs one that is not
    given, every correction is None and says so. Raises ResidualError where lengths differ, or dt_s is not positive.
    """
    if not dt_s > 0.0:
        raise ResidualError(f"dt_s is {dt_s:g}; it has to be positive")
    lengths = {name: len(values) for name, values in signals.items()}
    if len(set(lengths.values())) > 1:
        raise ResidualError(f"lengths differ: {', '.join(f'{name} {length}' for name, length in lengths.items())}")
    needed = tuple(dict.fromkeys((*signals_of(model.features), PHYSICS)))
    count = next(iter(lengths.values()), 0)
    if absent := [name for name in needed if name not in signals]:
        return [Correction(None, f"the model needs {', '.join(absent)}, which is not given")] * count
    memory, found = Memory(), []
    for place in range(count):
        memory, row = row_after(model.features, memory, {name: float(signals[name][place]) for name in needed}, place * dt_s)
        said = model.correction_one(row)
        found.append(Correction(None, said) if isinstance(said, str) else Correction(said))
    return found
