"""A stage in which a learned term can act: at which sites, on what, and what it may depend on there."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.stage import Stage
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]


@runtime_checkable
class Learnable(Stage, Protocol):
    """A stage that takes learned terms."""

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The sites at which a term can act here, each with what it is on, and which of these it is tried on."""

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term at a site, in its unit."""

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run, column → (samples,), where it is compared."""
