"""Sensors and clocks in many candidate machines at once: `twin.sensor`, lane by lane."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import On, called
from twin.gap.diagnosis import Effected
from twin.machine import MachineFile
from twin.sensor.reading import readings
from twin.sites import Site

Floats = NDArray[np.float64]
Values = Mapping[Effected, Mapping[str, Floats]]


@dataclass(frozen=True, slots=True, eq=False)
class Sensing:
    """The sensor of one signal: effect → parameter → (lanes,)."""

    effects: Mapping[str, Mapping[str, Floats]]

    @staticmethod
    def of(values: Values, signal: str, standing: Mapping[str, Mapping[str, Floats]] | None = None) -> "Sensing":
        """The sensor of `signal` among the effects of a model, on top of those that it has already."""
        mine = {e.effect: v for e, v in values.items() if e.on == signal and effect_named(e.effect).on is On.SIGNAL}
        return Sensing({**(standing or {}), **mine})

    def readings(self, values: Floats, period_s: float | Floats, starts: Sequence[int] = ()) -> Floats:
        """Return the readings of values, (lanes, n).

        period_s: from sample to sample, one or (n,); starts: samples at which the machine had come to rest, its sensors too
        """
        if not self.effects:
            return values
        since = np.array(np.broadcast_to(period_s, values.shape[1]), dtype=np.float64)
        since[list(starts)] = np.inf
        since[0] = 0.0
        rows = []
        for lane in range(len(values)):
            given = {e: {k: float(v[min(lane, len(v) - 1)]) for k, v in p.items()} for e, p in self.effects.items()}
            rows.append(readings(values[lane], since, given))
        return np.stack(rows)

    def value(self, reading: Floats) -> Floats:
        """Return the values at which the sensor at rest reads these, (lanes,)."""
        for name in sorted(self.effects):
            if undo := effect_named(name).undo:
                reading = np.asarray(called(undo, self.effects[name], reading))
        return reading

    def undone(self, readings: Floats) -> Floats:
        """Return the values behind readings, (n,), in each lane, (lanes, n), or (1, n) where no sensor is in the way."""
        values = readings[None, :]
        for name in sorted(self.effects):
            if undo := effect_named(name).undo:
                given = {key: np.atleast_1d(value)[:, None] for key, value in self.effects[name].items()}
                values = np.asarray(called(undo, given, values))
        return values


def standing_sensors(machine: MachineFile, signal: str) -> dict[str, dict[str, Floats]]:
    """Return the effects of a machine on what a signal reads, effect → parameter → (1,)."""
    there = [(e, effect_named(e.effect)) for e in machine.effects if e.on == signal]
    return {
        added.effect: {name: np.array([value]) for name, value in effect.checked(added.parameters).items()}
        for added, effect in there
        if effect.on is On.SIGNAL
    }


def sensor_effects(signals: Collection[str], left_out: Collection[str]) -> tuple[Effected, ...]:
    """Return the effects of the sensors of these signals, but for those that are left out."""
    known = [effect.name for effect in catalogue().values() if effect.on is On.SIGNAL and effect.name not in left_out]
    return tuple(Effected(name, signal) for name in known for signal in sorted(signals))


def seen_late(series: Floats, t_s: Floats, period_s: float, values: Values, site: Site, on: str, lanes: int) -> Floats:
    """A series, (n,) or (lanes, n), as it is seen late by the effects of a model at a site; as it is where none makes it late."""
    here = [(effect_named(e.effect), given) for e, given in values.items() if e.on == on]
    acting = [(effect.late_s, given) for effect, given in here if effect.late_s is not None and effect.site is site]
    if not acting:
        return series
    late_s = np.zeros((lanes, len(t_s)))
    for late, given in acting:
        for lane in range(lanes):
            own = {name: float(value[min(lane, len(value) - 1)]) for name, value in given.items()}
            late_s[lane] += called(late, own | {"time_s": t_s})
    if not late_s.any():
        return series
    ticks = np.arange(len(t_s))
    rows = np.broadcast_to(series, (lanes, len(t_s)))
    return np.stack([np.interp(ticks - own_s / period_s, ticks, row) for own_s, row in zip(late_s, rows, strict=True)])
