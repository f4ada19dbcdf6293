"""Screens learned terms by what unit moves of their values change in what is shown, beside what is left to be explained.

    r = S δ + J v,   δ ~ N(0, Σ) of the parent's own numbers,   v ~ N(0, s² C(ℓ)) of the values at the knots

S and J come from the simulator, at a small move; size s and length ℓ are those of the largest marginal likelihood (Rasmussen and
Williams 2006, section 5.4.1) on the runs that are fitted. What the linear term leaves on the runs that are not says how good it
is. Cheap, and only good for choosing what to fit and where to start.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.gap.fitting import Fitted
from twin.gap.learned.learnable import Learnable
from twin.gap.stages.free_term import SIGMA, FreeTerm

Floats = NDArray[np.float64]
STEP_PROBE = 1e-3
ROBUST = 20.0
SIZES = (0.5, 2.0, 8.0, 32.0, 128.0)
LENGTHS = (0.0, 0.06, 0.2, 0.6)
"""Sizes in small terms, lengths in parts of the range."""
WORTH = 10.0
"""Samples taken together that are worth one: neighbours are alike."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One run as it is screened: in σ, several samples taken together, outliers weighed down.

    bare: (n,) as the parent shows it; residual: (m,) measured minus shown; weight: (m,); slopes: (m, p) over the parent's numbers
    """

    run: int
    bare: Floats
    residual: Floats
    weight: Floats
    slopes: Floats
    fitted: bool


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """A learned term at its best linear values. theta: of parent and term; score: ln of how much more likely the runs become."""

    term: FreeTerm
    theta: Floats
    score: float


@dataclass(frozen=True, eq=False)
class Screen:
    """A stage at a parent, ready for terms to be tried on."""

    stage: Learnable
    parent: Fitted
    pieces: tuple[Piece, ...]
    together: int

    @staticmethod
    def of(stage: Learnable, parent: Fitted) -> "Screen":
        """Return the screen of a stage at a parent."""
        quiet = quiet_of(stage)
        together = stage.averaged
        pieces = []
        for number, observed in enumerate(stage.observed):
            shown = stage.predict(parent.model, parent.theta[None, :], number)[0]
            bare = shown if quiet is stage else quiet.predict(parent.model, parent.theta[None, :], number)[0]
            residual = _averaged(((observed.measured - shown) / observed.sigma)[None, :], together)[0]
            slopes = _averaged(_slopes(quiet, parent, number), together).T
            weight = 1.0 / np.sqrt(1.0 + (residual / ROBUST) ** 2 / together)
            pieces.append(Piece(number, bare, residual * weight, weight, slopes * weight[:, None], observed.fitted))
        return Screen(quiet, parent, tuple(pieces), together)

    @cached_property
    def _own(self) -> Floats:
        """The prior of the parent's numbers as rows, (p, p)."""
        return np.diag(1.0 / np.array([p.sigma for p in self.parent.model.free]))

    @cached_property
    def _start(self) -> Floats:
        """The residual of the runs that are fitted, and how far the parent's numbers are from their prior."""
        return np.concatenate([*(p.residual / self._root for p in self.pieces if p.fitted), -self._own @ self.parent.theta])

    @cached_property
    def _root(self) -> float:
        """The root of the noise: of what is left, by what samples are worth."""
        return float(np.sqrt(WORTH * max(np.mean(np.concatenate([p.residual for p in self.pieces if p.fitted]) ** 2), 1.0)))

    @cached_property
    def _solved(self) -> tuple[Floats, Floats]:
        """Q and R of what the parent's numbers can do."""
        slopes = [p.slopes / self._root for p in self.pieces if p.fitted]
        return tuple(np.linalg.qr(np.concatenate([*slopes, self._own])))  # type: ignore[return-value]

    @cached_property
    def _unseen_at_best(self) -> float:
        """Return the remainder of the parent on the runs that are not fitted, its own numbers at their linear best."""
        basis, upper = self._solved
        return self._unseen(_solved(upper, basis.T @ self._start), {})

    def screened(self, term: FreeTerm) -> Screened:
        """Return a term at its best linear values, its size and lengths chosen."""
        moves = {piece.run: self._moves(term, piece) for piece in self.pieces}
        changed = np.concatenate([moves[p.run] for p in self.pieces if p.fitted]) / self._root
        basis, upper = self._solved
        columns = np.concatenate([changed, np.zeros((len(self._own), changed.shape[1]))])
        free, through = (v - basis @ (basis.T @ v) for v in (self._start, columns))
        found = []
        for likelihood, chosen, values in self._sized(term, through.T @ through, through.T @ free):
            delta = _solved(upper, basis.T @ (self._start - columns @ values))
            after = self._unseen(delta, {run: move @ values for run, move in moves.items()})
            found.append((likelihood + 0.5 * (self._unseen_at_best - after), chosen, values, delta))
        score, chosen, values, delta = max(found, key=lambda f: f[0])
        low, high = (np.array([getattr(p, key) for p in self.parent.model.free]) for key in ("low", "high"))
        theta = np.clip(self.parent.theta + delta, low, high)
        z = np.linalg.solve(chosen.root, values * term.size)
        return Screened(chosen, np.concatenate([theta, z]), score)

    def _unseen(self, delta: Floats, changed: Mapping[int, Floats]) -> float:
        """Squares that are left on the runs that are not fitted, over the noise."""
        total = 0.0
        for p in self.pieces:
            if not p.fitted:
                total += float(np.sum((p.residual - p.slopes @ delta - changed.get(p.run, 0.0)) ** 2))
        return total / self._root**2

    def _moves(self, term: FreeTerm, piece: Piece) -> Floats:
        """Return the change that a move of each value by `size` makes, (m, knots)."""
        observed = self.stage.observed[piece.run]
        model = self.parent.model.with_term(replace(term, lengths={}))
        count = term.knots.count
        theta = np.concatenate([np.tile(self.parent.theta, (count, 1)), np.eye(count)], axis=1)
        changed = (self.stage.predict(model, theta, piece.run) - piece.bare) / observed.sigma
        changed[:, ~np.isfinite(observed.measured)] = 0.0
        return _averaged(changed, self.together).T * piece.weight[:, None]

    def _sized(self, term: FreeTerm, gram: Floats, towards: Floats) -> list[tuple[float, FreeTerm, Floats]]:
        """Return the term in each length, at its likeliest size: ln of the likelihood, the term, its values in small terms."""
        found = []
        for length in LENGTHS if any(len(k) > 2 for k in term.knots.by_column.values()) else LENGTHS[:1]:
            one = replace(term, lengths=_lengths(term, length))
            root = SIGMA * one.root / term.size
            powers, turned = np.linalg.eigh(root.T @ gram @ root)
            powers = np.maximum(powers, 0.0)
            along = turned.T @ (root.T @ towards)
            inner = 1.0 + np.square(SIZES)[:, None] * powers
            gains = 0.5 * (((np.array(SIZES)[:, None] * along) ** 2 / inner) - np.log(inner)).sum(axis=1)
            best = int(np.argmax(gains))
            values = SIZES[best] ** 2 * root @ (turned @ (along / inner[best]))
            found.append((float(gains[best]), replace(one, size=SIZES[best] * term.size), values))
        return found


def _lengths(term: FreeTerm, length: float) -> dict[str, float]:
    """Column → length, from one in parts of the range."""
    return {c: length * float(knots[-1] - knots[0]) for c, knots in term.knots.by_column.items() if len(knots) > 2}


def quiet_of(stage: Learnable) -> Learnable:
    """Return the stage without the courses of its disturbance, of which a signature needs none."""
    return replace(stage, disturbance=None) if getattr(stage, "disturbance", None) is not None else stage  # type: ignore[type-var]


def _solved(upper: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(upper, right), dtype=np.float64)


def _averaged(values: Floats, count: int) -> Floats:
    """Sums of `count` neighbours over √count, (lanes, m); a sample that is not there is 0."""
    whole = values.shape[1] // count * count
    known = np.nan_to_num(values[:, :whole]).reshape(len(values), whole // count, count)
    return np.asarray(known.sum(axis=2) / np.sqrt(count))


def _slopes(stage: Learnable, parent: Fitted, run: int) -> Floats:
    """Slopes of what a run shows over the parent's numbers, in σ, (p, n)."""
    observed = stage.observed[run]
    count = len(parent.theta)
    if not count:
        return np.zeros((0, len(observed.measured)))
    low, high = (np.array([getattr(p, key) for p in parent.model.free]) for key in ("low", "high"))
    up, down = (np.minimum(parent.theta + STEP_PROBE, high), np.maximum(parent.theta - STEP_PROBE, low))
    shown = stage.predict(parent.model, np.concatenate([parent.theta + np.diag(end - parent.theta) for end in (up, down)]), run)
    changed = (shown[:count] - shown[count:]) / np.maximum(up - down, 1e-12)[:, None] / observed.sigma
    return np.where(np.isfinite(observed.measured), np.nan_to_num(changed), 0.0)
