"""The result of a residual model on time that was held out, and the judgement whether that is enough to be used."""

from collections.abc import Mapping

from twin.anomaly.calibration import Finite, NotNegative, Record

IN_REGION_MIN = 0.2


class Interval(Record):
    """An estimate, with its interval of 90 %."""

    value: Finite
    low: Finite
    high: Finite

    def __str__(self) -> str:
        return f"{100 * self.value:.0f} % ({100 * self.low:.0f} to {100 * self.high:.0f})"


class HeldOut(Record):
    """The result of a model on held-out time, of the rows that are in its region.

    hours: held out, in_region: share of it; blocks: of `gap_s` each; over_constant: gain over the physics with a constant added
    by_regime: RMSE of physics, RMSE corrected, share of the rows; importance: K of RMSE that a feature is worth, by name
    """

    hours: NotNegative
    gap_s: NotNegative
    blocks: int
    in_region: NotNegative
    physics_rmse_k: NotNegative
    corrected_rmse_k: NotNegative
    constant_rmse_k: NotNegative
    linear_rmse_k: NotNegative
    gain: Interval
    over_constant: Interval
    by_regime: Mapping[str, tuple[Finite, Finite, Finite]] = {}
    importance: Mapping[str, Finite] = {}

    @property
    def why_refused(self) -> str:
        """Why there is no model; '' where there is one."""
        if self.in_region < IN_REGION_MIN:
            return (
                f"only {100 * self.in_region:.0f} % of the held-out time is in the region of the training: train on more programs"
            )
        if self.gain.low <= 0.0:
            return f"gain over the physics on held-out time is {self.gain}, which is none for sure"
        if self.over_constant.low <= 0.0:
            return (
                f"gain over a constant of held-out time is {self.over_constant}, which is none for sure: what the physics gets "
                "wrong there is an offset (ambient, sensor), or has another cause than these features"
            )
        return ""
