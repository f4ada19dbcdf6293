"""The null distribution of healthy machines: how far a candidate seems to help where there is nothing to find.

Calibrated with the blind check's plant on healthy machines of other programs and other seeds than those it is judged on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt

from scipy.special import erfc

from twin.gap.diagnosis import Effected
from twin.gap.evidence import Advantage

SMOOTH = 1.3
"""Greatest gap of a signal that a healthy twin leaves where nothing is rough, in floors."""


@dataclass(frozen=True, slots=True)
class Null:
    """Thresholds.

    closes, closes_any: decrease of a signal's mean square, in floors², of one candidate, of any other
    share_least: part of what is above the floor there that has to be taken away; sigmas: of the advantage
    much_share, much_closes, much_sigmas: share of a large gap, in floors², that may be taken away less surely: it may lie in few
        blocks, which differ
    sigmas_spread: standard deviation of those on healthy machines; rms_typical: what a healthy twin leaves of a signal, in floors
    """

    closes: Mapping[str, float] = field(default_factory=dict)
    closes_any: float = 0.35
    share_least: float = 0.05
    sigmas: float = 3.0
    much_share: float = 0.8
    much_closes: float = 10.0
    much_sigmas: float = 2.0
    sigmas_spread: float = 1.5
    rms_typical: float = 1.1

    def exceeded(self, effected: Effected, over: Advantage, healthy_rms: float = SMOOTH) -> bool:
        """Return whether a candidate helps more than it does on any healthy machine.

        healthy_rms: what a healthy twin leaves in this stage at worst, in floors; where that is much, much has to be taken away
        """
        return self._exceeded(self.closes.get(effected.effect, self.closes_any), over, healthy_rms)

    def exceeded_by_any(self, over: Advantage, healthy_rms: float = SMOOTH) -> bool:
        """Apply `exceeded` to something that is no effect of the catalogue."""
        return self._exceeded(self.closes_any, over, healthy_rms)

    def _exceeded(self, closes: float, over: Advantage, healthy_rms: float) -> bool:
        rough = max((healthy_rms**2 - 1.0) / (SMOOTH**2 - 1.0), 1.0)
        much = over.share > self.much_share and over.closes > self.much_closes * rough
        surely = over.sigmas > (self.much_sigmas if much else self.sigmas)
        return surely and over.closes > closes * rough and over.share > self.share_least

    def p_value(self, over: Advantage) -> float:
        """Return the probability of a healthy machine showing so much: one-sided, with the spread that healthy machines have."""
        return float(0.5 * erfc(over.sigmas / self.sigmas_spread / sqrt(2.0)))


NULL = Null()
