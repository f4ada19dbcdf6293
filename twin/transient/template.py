"""The shape of a transient: how it begins, how it ends, and what lies between.

The beginning (a deceleration, a stop) and the end (a restart) have a shape of their own. The time between them may be longer:
a magazine that has to search, an operator. So the two are matched apart, with a flexible gap. A machine is faster or slower
as a whole, too: the two are stretched alike.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.transient.errors import TransientError

Floats = NDArray[np.float64]
STRETCHES = tuple(float(value) for value in np.round(np.geomspace(0.7, 1.5, 13), 4))
SAMPLES_MAX = 6000
"""Most samples of a whole pattern at its longest, so that sums of squares stay below 2^53."""


@dataclass(frozen=True, eq=False)
class Template:
    """start: (d,), between: (g,), end: (r,): levels at `period_s`, jointly of mean 0 and deviation 1 over start and end.

    stall_s: how much longer the time between may be than its stretched self; stretches: (k,)
    """

    period_s: float
    start: Floats
    between: Floats
    end: Floats
    stall_s: float
    stretches: tuple[float, ...] = STRETCHES

    def __post_init__(self) -> None:
        if min(len(self.start), len(self.end)) < 3:
            raise TransientError(
                f"a template of {len(self.start)} + {len(self.end)} samples is too short to know anything by: sample finer"
            )
        if self.bank.samples > SAMPLES_MAX:
            raise TransientError(
                f"the pattern is up to {self.bank.samples} samples long, {SAMPLES_MAX} is the most: sample coarser than every "
                f"{self.period_s:g} s, or allow a stall of less than {self.stall_s:g} s"
            )

    @property
    def whole(self) -> Floats:
        """Beginning, between and end, (d + g + r,)."""
        return np.concatenate([self.start, self.between, self.end])

    @property
    def seconds(self) -> float:
        """The duration of the transient, without stretch or stall."""
        return len(self.whole) * self.period_s

    @cached_property
    def bank(self) -> "Bank":
        """Its stretched forms, ready to be matched."""
        return bank_of(self)


@dataclass(frozen=True, eq=False)
class Bank:
    """Stretched forms of both parts, each of mean 0 and norm 1, flush at their last sample, before it zeros.

    weights: (2 k, samples): the starts, then the ends
    terms: (8, k): samples of start and of end; least and most samples between; norm of start and of end and mean of start and of
    end, where both together have mean 0 and norm 1
    samples: of the longest pattern
    """

    weights: Floats
    terms: Floats
    samples: int


def resampled(values: Floats, count: int) -> Floats:
    """(n,) as (count,), from first to last sample, linear between them."""
    return np.interp(np.linspace(0.0, len(values) - 1.0, count), np.arange(len(values)), values)


def bank_of(template: Template) -> Bank:
    """The bank of a template."""
    count = len(template.stretches)
    parts = [
        [resampled(part, max(3, round(len(part) * stretch))) for part in (template.start, template.end)]
        for stretch in template.stretches
    ]
    weights = np.zeros((2 * count, max(len(part) for both in parts for part in both)))
    terms = np.empty((8, count))
    stall = round(template.stall_s / template.period_s)
    for k, ((start, end), stretch) in enumerate(zip(parts, template.stretches, strict=True)):
        both = np.concatenate([start, end])
        both = both - both.mean()
        both /= np.linalg.norm(both)
        start, end = both[: len(start)], both[len(start) :]  # noqa: PLW2901
        norms = [float(np.linalg.norm(part - part.mean())) for part in (start, end)]
        if min(norms) <= 1e-9:
            raise TransientError("the beginning or the end of the template is flat: nothing to know it by")
        weights[k, -len(start) :] = (start - start.mean()) / norms[0]
        weights[count + k, -len(end) :] = (end - end.mean()) / norms[1]
        nominal = len(template.between) * stretch
        least, most = int(0.8 * nominal), int(np.ceil(1.2 * nominal)) + stall
        terms[:, k] = len(start), len(end), least, most, *norms, start.mean(), end.mean()
    return Bank(weights, terms, int((terms[0] + terms[1] + terms[3]).max()))
