"""A part of an axis that is compared alone: what drives it, what it answers with, and what can be found in it."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.axis_terms import series_of_terms
from twin.gap.stages.free import Free
from twin.gap.stages.stage import Model
from twin.learned.sites import QUANTITIES
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
ALIKE_S = 0.02
"""Time over which what is left of a loop goes with itself."""


class Loop(Protocol):
    """One part of an axis. All series of a run are those of its stretches of motion, one after another."""

    @property
    def name(self) -> str:
        """`controller`, `mechanics` or `table`."""

    @property
    def driven_by(self) -> tuple[str, ...]:
        """Columns without the axis letter, that drive it; all have to be recorded."""

    @property
    def compared(self) -> str:
        """The column, without the axis letter, that it answers with."""

    @property
    def healthy_rms(self) -> float:
        """The most that a healthy machine's twin leaves, in floors."""

    @property
    def sites(self) -> tuple[LearnedSite, ...]:
        """The sites in it at which a learned term may act."""

    def acts(self, effect: Effect) -> bool:
        """Return True where the effect changes what it answers."""

    def sensors(self, effect: Effect) -> tuple[str, ...]:
        """Columns, without the axis letter, on which such a sensor would show."""

    def constants(self, free: tuple[Free, ...]) -> tuple[Free, ...]:
        """Those of the axis' uncertain constants that it depends on."""

    def answer(self, axis: AxisStage, model: Model, theta: Floats, data: AxisRunData) -> Floats:
        """Return what the machine at each row of θ answers, (lanes, n)."""

    def recorded(self, data: AxisRunData) -> Floats:
        """Return what was recorded of it, (n,), NaN where it was not."""

    def timing(self, axis: AxisStage, data: AxisRunData) -> Floats:
        """Return the error of the answer, (n,), that comes from not knowing when within a period it was sampled."""


def places(data: AxisRunData) -> NDArray[np.intp]:
    """Return the places of the samples of all stretches of motion in the run, one after another."""
    parts = [np.arange(len(data.t_s), dtype=np.intp)[stretch] for stretch in data.stretches()]
    return np.concatenate(parts) if parts else np.array([], dtype=np.intp)


def over_stretches(data: AxisRunData, values: Floats) -> Floats:
    """Return (n,) over the stretches of motion, one after another."""
    return np.asarray(values[places(data)])


def added_at(
    sites: tuple[LearnedSite, ...], model: Model, theta: Floats, axis: AxisStage, data: AxisRunData, stretch: slice
) -> dict[str, Floats]:
    """Return quantity → (lanes, ticks) of the learned terms of machine and model at these sites, over a stretch."""
    here = {quantity for site in sites for quantity in QUANTITIES.get(site, {})}
    series = series_of_terms(model, theta, axis.letter, data.arguments, stretch, axis.terms)
    return {quantity: values for quantity, values in series.items() if quantity in here}
