"""The signature of an alarm: what is left over by signal and scale, where it was cut, and how like another it is.

    likeness = max(cos(a, b), 0.95 · cos(a*, b*)) · agreement, at least 0
    agreement: 1 of the same program and tool, .9 if one of them differs, .8 if both do

a, b: what is left beside the peers, in tails of healthy parts, with its sign, by signal and scale; a*, b*: by signal alone, of
its largest scale, since an alarm that has just begun shows on the short scales and an old one on the long ones. 1.0 is the same
share of each signal on each scale in the same program and with the same tool; the size does not matter. Signatures with no signal
in common, or with opposite signs, have 0. Likeness below `LIKE_MIN` is chance among a handful of signals, and is not shown.
"""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import NamedTuple

SHARES_MAX = 10
SHARE_LEAST = 0.1
"""A smaller part of the largest share is noise, and is left out."""
LIKE_MIN = 0.7
ONE_DIFFERS = 0.9
SIGNALS_ONLY = 0.95
GROWTH = 1.1
"""A share that has grown by less is as it was."""
DIGITS = 4
NAME_MAX = 120


class Share(NamedTuple):
    """A signal on a time scale; left: beside the peers, signed, in tails of healthy parts, before any raised limit."""

    signal: str
    scale: str
    left: float

    @property
    def side(self) -> int:
        """1 above what is usual, -1 below."""
        return 1 if self.left > 0.0 else -1


NOTHING = Share("", "", 0.0)


class Signature(NamedTuple):
    """The largest shares, largest first, and the cut that they are from; operation as a CutRecord names it."""

    operation: str
    program: str
    tool: int | None
    shares: tuple[Share, ...]

    @property
    def largest(self) -> float:
        """Return the size of the largest share, in tails."""
        return abs(self.shares[0].left) if self.shares else 0.0


def signature_of(shares: Iterable[Share], operation: str, program: str | None, tool: int | None) -> Signature:
    """Return the signature: at most `SHARES_MAX` shares, none below a tenth of the largest.

    >>> load, noise = Share("spindle_load_pct", "cut", 2.0), Share("spindle_rpm", "cut", 0.1)
    >>> [share.signal for share in signature_of([noise, load], "O1|T5|1", "O1", 5).shares]
    ['spindle_load_pct']
    """
    known = sorted((one for one in shares if math.isfinite(one.left) and one.left != 0.0), key=lambda one: -abs(one.left))
    least = SHARE_LEAST * abs(known[0].left) if known else 0.0
    kept = (Share(one.signal, one.scale, _rounded(one.left)) for one in known if abs(one.left) >= least)
    return Signature(operation[:NAME_MAX], (program or "")[:NAME_MAX], tool, tuple(kept)[:SHARES_MAX])


def shares_of(signals: Sequence[str], scales: Sequence[str], left: Sequence[float]) -> list[Share]:
    """Return the shares of a row that holds, for each signal, what is left on each scale.

    >>> [one.scale for one in shares_of(["spindle_load_pct"], ["seconds", "cut"], [0.5, 2.0])]
    ['seconds', 'cut']
    """
    names = [(signal, scale) for signal in signals for scale in scales]
    return [Share(signal, scale, value) for (signal, scale), value in zip(names, left, strict=True)]


def likeness(one: Signature, other: Signature) -> float:
    """Return how like two signatures are, 0 to 1.

    >>> load = Share("spindle_load_pct", "cut", 2.0)
    >>> a, b = (signature_of([load], "O1|T5|1", "O1", tool) for tool in (5, 6))
    >>> likeness(a, a), likeness(a, b)
    (1.0, 0.9)
    """
    cosine = max(_cosine(_by_scale(one), _by_scale(other)), SIGNALS_ONLY * _cosine(_by_signal(one), _by_signal(other)))
    if cosine <= 0.0:
        return 0.0
    agreement = 1.0 if one.program == other.program else ONE_DIFFERS
    if one.tool != other.tool:
        agreement = ONE_DIFFERS if agreement == 1.0 else 2.0 * ONE_DIFFERS - 1.0
    return round(cosine * agreement, 3)


def envelope(before: Signature, now: Signature) -> Signature:
    """Return the largest that was seen of each share; where nothing has grown, the very object. The cut is that of the largest.

    >>> load = [Share("spindle_load_pct", "cut", size) for size in (2.0, 2.1, 3.0)]
    >>> first, hardly, larger = (signature_of([share], "O1|T5|1", "O1", 5) for share in load)
    >>> envelope(first, hardly) is first, envelope(first, larger).shares[0].left
    (True, 3.0)
    """
    largest = {share[:2]: share for share in before.shares}
    grown = [share for share in now.shares if abs(share.left) > GROWTH * abs(largest.get(share[:2], NOTHING).left)]
    if not grown:
        return before
    largest.update((share[:2], share) for share in grown)
    where = now if now.largest > before.largest else before
    found = signature_of(largest.values(), where.operation, where.program, where.tool)
    return before if found == before else found


def _cosine(one: Mapping[Hashable, float], other: Mapping[Hashable, float]) -> float:
    product = sum(value * other.get(key, 0.0) for key, value in one.items())
    if product <= 0.0:
        return 0.0
    return min(product / (math.hypot(*one.values()) * math.hypot(*other.values())), 1.0)


def _by_scale(signature: Signature) -> dict[Hashable, float]:
    return {share[:2]: share.left for share in signature.shares}


def _by_signal(signature: Signature) -> dict[Hashable, float]:
    return {share.signal: share.left for share in reversed(signature.shares)}


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
