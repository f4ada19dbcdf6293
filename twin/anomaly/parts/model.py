"""The model of parts: what training learned of a machine, before anything was told of the week that is judged."""

import bisect
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, model_validator

from twin.anomaly.calibration import Finite, NotNegative, Positive, Record
from twin.anomaly.common_features import MEMORY_S
from twin.anomaly.parts import quantity, scales
from twin.anomaly.parts.heat import EVERY_S, TAUS_S, base_s
from twin.anomaly.parts.levels import BATCH_VAR, TOOL_VAR, Level
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.shared import HARDER_FRESH_S, HARDER_GAIN, SHAKEN_FRESH_S, SHAKEN_GAIN, felt_shares
from twin.anomaly.parts.usual import FIRST_PRIORS, Usual

OPERATIONS_MAX = 500
SIGNALS_MAX = 16
RPM_STEP = 500.0
LEAST_SHARE = 0.5
"""A section has at least this share of the usual spread: what repeats too well in a few parts is luck, or rounding."""
SILENT = {Kind.TEMPERATURE: ("seconds",)}
"""The scales that say nothing of a kind: a temperature is slow."""
EASIER = {Kind.LOAD: ("operation", "part", "tool"), Kind.VIBRATION: ("cut", "operation", "part", "tool")}
"""The scales on which a cut that takes less than before is no fault: its tool is a new one, its material a softer one."""
ALIKE_MAX = 15.0


@dataclass(frozen=True, slots=True)
class Plan:
    """The figures of a model that a step needs, put together once. *_at: places of signals, −1 = the model has none."""

    kinds: tuple[int, ...]
    floors: tuple[float, ...]
    shares: tuple[float, ...]
    heat_every: int
    memory_ticks: int
    powers: tuple[float, ...]
    heat_shares: tuple[tuple[float, ...], tuple[float, ...]]
    drivers_at: tuple[int, int]
    speed_at: int
    feed_at: int
    load_at: int
    idle_pct: tuple[float, ...]
    least: tuple[float, ...]
    prior: tuple[float, ...]
    first: tuple[float, ...]
    over_spread: tuple[float, ...]
    over_twin: tuple[float, ...]
    over_up: tuple[float, ...]
    over_down: tuple[float, ...]
    blank: tuple[float, ...]
    flat: tuple[float, ...]
    levelled: tuple[int, ...]
    cuts: tuple[bool, ...]
    alike: tuple[float, ...]
    by_peers: tuple[int, ...]
    gain: tuple[float, ...]
    felt_shares: tuple[float, float]
    fresh_ticks: tuple[int, int]


class PartsModel(Record):
    """signals: in the order of a row; tick_s: the tick it was trained with
    idle: load of the spindle idle at a speed, (rpm, %), ascending
    power: of the feed override in each signal; heat: coefficients of each temperature, () for others
    spread: of a tick about the centre of its section, by signal, pooled over operations
    twin_offset, twin_spread: of a section's quantity beside the twin's expectation, by signal; spread 0 = it has none
    up, down: tails by signal, each on all scales; usual: by operation; material, tools: levels when training ended
    still: quantity of a vibration while the spindle stands, by signal; follows_parts: False = beside the twin only
    gain: how many times as much as its peers the machine feels of a shared vibration or load, by signal, () = not known
    step: deviation of the change from tick to tick, by signal, 0 = not known
    """

    signals: Annotated[tuple[str, ...], Field(min_length=1, max_length=SIGNALS_MAX)]
    tick_s: Positive
    idle: tuple[tuple[NotNegative, NotNegative], ...] = ((0.0, 0.0),)
    power: tuple[Finite, ...] = ()
    heat: tuple[tuple[Finite, ...], ...] = ()
    spread: tuple[Positive, ...] = ()
    twin_offset: tuple[Finite, ...] = ()
    twin_spread: tuple[NotNegative, ...] = ()
    up: tuple[Positive, ...] = ()
    down: tuple[Positive, ...] = ()
    usual: Annotated[dict[str, Usual], Field(max_length=OPERATIONS_MAX)] = Field(default={})
    material: Level = Level((), BATCH_VAR)
    tools: Annotated[dict[str, Level], Field(max_length=OPERATIONS_MAX)] = Field(default={})
    still: tuple[Finite, ...] = ()
    follows_parts: bool = True
    step: tuple[NotNegative, ...] = ()
    gain: tuple[Positive, ...] = ()

    @model_validator(mode="after")
    def _has_all_tails(self) -> Self:
        wanted = len(self.signals) * scales.COUNT
        for name, tails in (("up", self.up), ("down", self.down)):
            if tails and len(tails) != wanted:
                raise ValueError(
                    f"{name} has {len(tails)} tails for {len(self.signals)} signals, {wanted} are needed: train again"
                )
        return self

    def idle_at(self, rpm: float) -> float:
        """Return what the spindle takes idle, %.

        >>> PartsModel(signals=("spindle_load_pct",), tick_s=1.0, idle=((0.0, 1.0), (1000.0, 3.0))).idle_at(500.0)
        2.0
        """
        points = self.idle
        at = bisect.bisect_right(points, (rpm, math.inf))
        if at == 0 or at == len(points):
            return points[max(0, at - 1)][1]
        (x0, y0), (x1, y1) = points[at - 1], points[at]
        return y0 + (y1 - y0) * (rpm - x0) / (x1 - x0)

    def changed(self, **fields: object) -> "PartsModel":
        """Return the model with other values of some fields, checked; the plan is another one then."""
        return PartsModel.model_validate({**{name: getattr(self, name) for name in PartsModel.model_fields}, **fields})

    @cached_property
    def plan(self) -> Plan:
        """The figures that a step needs."""
        count = len(self.signals)
        kinds = tuple(quantity.kind_of(signal) for signal in self.signals)
        spread = self.spread or tuple(quantity.SPREADS[kind] for kind in kinds)
        up, down = (tails or (1.0,) * (count * scales.COUNT) for tails in (self.up, self.down))

        def at(name: str) -> int:
            return self.signals.index(name) if name in self.signals else -1

        counts = [0.0 if scale in SILENT.get(kind, ()) else 1.0 for kind in kinds for scale in scales.SCALES]
        cuts = [kind in LEVELLED for kind in kinds]
        falls = [scale not in EASIER.get(kind, ()) for kind in kinds for scale in scales.SCALES]
        less = [count if falling else 0.0 for count, falling in zip(counts, falls, strict=True)]
        every = max(1, round(EVERY_S / self.tick_s))
        steps = range(int(quantity.RPM_MAX / RPM_STEP) + 1)
        return Plan(
            kinds=tuple(map(int, kinds)),
            floors=tuple(quantity.floor_of(signal) for signal in self.signals),
            powers=self.powers,
            shares=scales.shares(self.tick_s),
            memory_ticks=round(MEMORY_S / self.tick_s),
            heat_every=every if any(self.heat) else 0,
            heat_shares=(
                tuple(every * self.tick_s / tau_s for tau_s in TAUS_S),
                tuple(every * self.tick_s / base_s(name) for name in self.signals),
            ),
            drivers_at=(at(quantity.SPEED), at(quantity.LOAD)),
            speed_at=at(quantity.SPEED),
            feed_at=at(quantity.FEED),
            load_at=at(quantity.LOAD),
            idle_pct=tuple(self.idle_at(step * RPM_STEP) for step in steps),
            least=tuple(
                max(quantity.SPREAD_LEAST[kind], LEAST_SHARE * own) ** 2 for kind, own in zip(kinds, spread, strict=True)
            ),
            prior=tuple(value * value for value in spread),
            first=tuple(FIRST_PRIORS * value * value if self.spread else 0.0 for value in spread),
            over_spread=tuple(1.0 / value for value in spread),
            over_twin=tuple(1.0 / value if value else 0.0 for value in self.twin_spread or (0.0,) * count),
            over_up=tuple(share / value for share, value in zip(counts, up, strict=True)),
            over_down=tuple(share / value for share, value in zip(less, down, strict=True)),
            blank=(0.0,) * (count * scales.COUNT),
            flat=(0.0,) * count,
            levelled=tuple(at for at, kind in enumerate(kinds) if kind in LEVELLED),
            cuts=tuple(cuts),
            alike=tuple(_alike(step, own) for step, own in zip(self.step or (0.0,) * count, spread, strict=True)),
            by_peers=tuple(
                at * scales.COUNT + scale
                for at, kind in enumerate(kinds)
                for scale in range(scales.COUNT)
                if kind not in LEVELLED or (kind is Kind.LOAD and scale < scales.OPERATION)
            ),
            gain=self.gain or tuple(SHAKEN_GAIN if kind is Kind.VIBRATION else HARDER_GAIN for kind in kinds),
            felt_shares=felt_shares(self.tick_s),
            fresh_ticks=(round(SHAKEN_FRESH_S / self.tick_s), round(HARDER_FRESH_S / self.tick_s)),
        )

    @property
    def powers(self) -> tuple[float, ...]:
        """Powers of the feed override, by signal."""
        return self.power or tuple(quantity.POWERS.get(quantity.kind_of(signal), 0.0) for signal in self.signals)

    def tool_level(self, tool: str) -> Level:
        """Return the level of a tool when training ended, which may have been long ago; of one that was not seen, none."""
        known = self.tools.get(tool)
        return Level((0.0,) * len(self.signals) if known is None else known.values, TOOL_VAR)


def _alike(step: float, spread: float) -> float:
    """Return how many ticks say as much as one that has no neighbours, from how far one is from the next."""
    correlation = max(0.0, 1.0 - 0.5 * (step / spread) ** 2)
    return min(ALIKE_MAX, (1.0 + correlation) / max(1e-3, 1.0 - correlation))


LEVELLED = frozenset({Kind.LOAD, Kind.VIBRATION})
"""The kinds that follow wear and material."""
