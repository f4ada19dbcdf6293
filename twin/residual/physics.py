"""The physics that a residual model corrects: a correction of one network is none of another."""

from pydantic import Field

from twin.anomaly.calibration import Finite, NotNegative, Positive, Record


class Physics(Record):
    """The constants of the network that is corrected, and the ambient temperature where no signal tells it."""

    alpha_w_per_pct_rpm2: NotNegative = 1.8e-8
    beta_w_per_rpm: NotNegative = 1.2e-3
    resistance_k_per_w: Positive = 0.18
    capacity_j_per_k: Positive = 14_500.0
    ambient_temp_c: Finite | None = Field(default=None)

    @property
    def time_constant_s(self) -> float:
        """R·C."""
        return self.resistance_k_per_w * self.capacity_j_per_k

    @property
    def constants(self) -> dict[str, float]:
        """As `twin.heat.run` takes them."""
        told = {name: getattr(self, name) for name in ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w")}
        return told | {"heat_capacity_j_per_k": self.capacity_j_per_k}
