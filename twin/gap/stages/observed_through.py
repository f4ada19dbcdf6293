"""What sensors and clocks make of a signal in many candidate machines at once: `twin.sensor`, lane by lane."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Effected
from twin.sensor.reading import readings

Floats = NDArray[np.float64]
Values = Mapping[Effected, Mapping[str, Floats]]


def lags_to_try(period_s: float) -> tuple[dict[str, float], ...]:
    """Time constants of a slow sensor to start from: what one of 50 periods does says little of one of a half."""
    return tuple({"time_constant_s": n * period_s} for n in (0.5, 2.0, 8.0, 40.0))


@dataclass(frozen=True, slots=True, eq=False)
class Sensing:
    """The sensor of one signal: effect → parameter → (lanes,)."""

    effects: Mapping[str, Mapping[str, Floats]]

    @staticmethod
    def of(values: Values, signal: str) -> "Sensing":
        """The sensor of `signal` among the effects of a model."""
        return Sensing({e.effect: v for e, v in values.items() if e.on == signal and e.effect.startswith("sensor_")})

    def readings(self, values: Floats, period_s: float) -> Floats:
        """What is read of (lanes, n)."""
        if not self.effects:
            return values
        since = np.full(values.shape[1], period_s)
        since[0] = 0.0
        rows = []
        for lane in range(len(values)):
            given = {e: {k: float(v[min(lane, len(v) - 1)]) for k, v in p.items()} for e, p in self.effects.items()}
            rows.append(readings(values[lane], since, given))
        return np.stack(rows)

    def value(self, reading: Floats) -> Floats:
        """What is where the sensor at rest reads (lanes,): scale and bias undone."""
        scale = self.effects.get("sensor_scale", {}).get("scale", np.ones(1))
        bias = self.effects.get("sensor_bias", {}).get("bias", np.zeros(1))
        return np.asarray((reading - bias) / np.where(np.abs(scale) > 1e-9, scale, 1.0))


def seen_earlier(values: Floats, t_s: Floats, effects: Values) -> Floats:
    """(lanes, n) as another clock stamps them, where the model has one."""
    clock = effects.get(Effected("clock_drift"))
    if clock is None or len(t_s) < 2:
        return values
    period_s = float(t_s[1] - t_s[0])
    ticks = np.arange(len(t_s))
    rows = []
    for lane in range(len(values)):
        ppm, offset = (float(clock[k][min(lane, len(clock[k]) - 1)]) for k in ("ppm", "offset_s"))
        late = (offset + 1e-6 * ppm * t_s) / period_s
        rows.append(np.interp(ticks - late, ticks, values[lane]))
    return np.stack(rows)
