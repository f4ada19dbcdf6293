"""Weeks of a machine under the fold of the gap: its spindle turns in air and its axes stand, with noise."""

from collections.abc import Callable
from datetime import UTC, datetime
from random import Random
from typing import Any

from processors.contract import Sample, SampleKind
from processors.description import Description
from processors.gap.config import Config
from processors.gap.described import described
from processors.gap.processor import GROWING, step
from processors.gap.state import State
from sparkplug.metric import Reading
from sparkplug.quality import Quality

DAY_S, HOUR_S = 86_400.0, 3600.0
BEGIN_S = 1_780_272_000.0  # 2026-06-01T00:00:00Z
DRIVE = {"rated_power_kw": 7.5, "idle_power_kw": 0.225}  # 3 % in air


class Weeks:
    """A machine under the fold: its spindle turns in air and its axes stand, with the noise of every hour and of every sample.

    drifts: by signal, what is added to its measured value at a time since the end of the healthy period, s
    """

    def __init__(self, *, tick_s: float = 600.0, healthy_hours: float = 336.0, seed: int = 1, **table: Any) -> None:
        table = (
            {"healthy_from": datetime.fromtimestamp(BEGIN_S, UTC), "gap_s_max": 3600.0} | DRIVE | {"publish_s": HOUR_S} | table
        )
        self.config = Config(tick_s=tick_s, healthy_hours=healthy_hours, **table)
        self.description: Description | None = None
        self.state, self.random, self.at_s = State(), Random(seed), BEGIN_S
        self.hourly = {"load": 0.0, "kelvin": 0.0, "axis": 0.0}
        self.shown: dict[str, Any] = {}
        self.growing_since_s: float | None = None
        self.alarms = 0

    @property
    def healthy_until_s(self) -> float:
        return BEGIN_S + self.config.healthy_hours * HOUR_S

    def run(self, seconds: float, drift: Callable[[str, float], float] = lambda _signal, _at_s: 0.0, **values: Any) -> "Weeks":
        """Go on for so long; `values` stand in place of what is measured."""
        until_s = self.at_s + seconds
        while self.at_s < until_s:
            self.at_s += self.config.tick_s
            if self.at_s % HOUR_S < self.config.tick_s:
                self.hourly = {name: 0.6 * was + 0.8 * self.random.gauss(0.0, 0.3) for name, was in self.hourly.items()}
            self._tick(drift, values)
        return self

    def _tick(self, drift: Callable[[str, float], float], values: dict[str, Any]) -> None:
        since_s = self.at_s - self.healthy_until_s
        measured = {
            "spindle_rpm": 6000.0 + self.random.gauss(0.0, 2.0),
            "spindle_rpm_cmd": 6000.0,
            "feed_mm_min": 0.0,
            "exec_state": "ACTIVE",
            "tool_change_active": False,
            "spindle_load_pct": 3.2 + self.hourly["load"] + self.random.gauss(0.0, 0.5) + drift("spindle_load_pct", since_s),
            "axis_z_load_pct": 31.0 + self.hourly["axis"] + self.random.gauss(0.0, 0.8) + drift("axis_z_load_pct", since_s),
            "twin/spindle_temp_residual_k": self.hourly["kelvin"]
            + self.random.gauss(0.0, 0.1)
            + drift("spindle_temp_c", since_s),
            "twin/spindle_temp_rise_k": 9.0,
        } | values
        row = {name: Reading(name, value, 0, Quality.GOOD, None, None, False) for name, value in measured.items()}
        self.state, outputs = step(
            described(self.config, self.description), self.state, Sample("vmc", SampleKind.TICK, self.at_s, row)
        )
        before = self.shown.get(GROWING)
        self.shown |= {output.name: output.value for output in outputs}
        if self.shown.get(GROWING) and not before:
            self.alarms += 1
            self.growing_since_s = self.growing_since_s or self.at_s

    def days_to_alarm(self) -> float:
        """The time from the end of the healthy period on."""
        assert self.growing_since_s is not None, "no alarm"
        return (self.growing_since_s - self.healthy_until_s) / DAY_S
