"""The table `[loop]` of processors.toml: what happens by itself, and by which figures. The values here are the defaults.

[loop]
promote = "by_rule"

[loop.machines.okuma]
shadow_hours = 72.0
"""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from processors.config import MACHINES, Configuration, read_tables, table_faults
from processors.errors import ConfigurationError
from processors.gap.config import Config as GapConfig

TABLE, GAP = "loop", "gap"
Hours = Annotated[float, Field(ge=0.0, le=8766.0)]
Floors = Annotated[float, Field(ge=0.0, le=1000.0)]


class Diagnose(StrEnum):
    """The way a diagnosis begins."""

    BY_ITSELF = "by_itself"
    BY_HAND = "by_hand"


class Promote(StrEnum):
    """The way a challenger is promoted."""

    BY_HAND = "by_hand"
    BY_RULE = "by_rule"


class LoopConfig(BaseModel):
    """See docs/how-to/loop.md, which has a line on each. Times are those of the machine's own clock."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    diagnose: Diagnose = Field(
        default=Diagnose.BY_ITSELF, description="`by_itself`: a gap that stays open is diagnosed; or `by_hand`"
    )
    window_hours: float = Field(default=8.0, gt=0.0, le=720.0, description="history in a case, where nothing says since when")
    open_hours: Hours = Field(default=2.0, description="how long a gap is open before a diagnosis begins automatically")
    history_days: float = Field(default=30.0, gt=0.0, le=366.0, description="no case reaches further back")
    again_hours: Hours = Field(default=24.0, description="pause after a diagnosis that led to nothing")
    shadow_s: float = Field(default=900.0, ge=0.0, le=31e6, description="time beside the live twin, without runs to score it on")
    promote: Promote = Field(
        default=Promote.BY_HAND, description="`by_hand`: a person promotes; or `by_rule`, after `shadow_hours`"
    )
    shadow_hours: Hours = Field(default=24.0, description="time beside the live twin, before the rule promotes")
    promote_floors: Floors = Field(default=0.3, description="how much better it must be over all signals, × the repeatability")
    back_hours: Hours = Field(default=24.0, description="how long the gap is watched after a promotion")
    back_floors: Floors = Field(default=0.5, description="a gap larger by this, × the repeatability, takes a promotion back")
    cases_max: int = Field(default=5, ge=1, le=1000, description="cases that are kept of a machine")
    programs: Path | None = Field(default=None, description="folder with the NC files that the machine runs")
    ambient_c: float | None = Field(
        default=None, ge=-50.0, le=80.0, description="temperature of the hall, where no signal has it"
    )


class LoopConfiguration:
    """The values for all machines, and for those that have their own. Raises ConfigurationError naming key and value.

    gap: the configuration of the processor `gap`, which states since when a machine was healthy
    """

    def __init__(self, table: Mapping[str, Any] | None = None, gap: Configuration[GapConfig] | None = None) -> None:
        self._gap = gap
        shared = dict(table or {})
        machines = shared.pop(MACHINES, {})
        if not isinstance(machines, dict) or not all(isinstance(own, dict) for own in machines.values()):
            raise ConfigurationError(f"[{TABLE}.{MACHINES}] has to hold one table for each machine")
        self.default = _validated(shared, TABLE)
        self._own = {name: _validated({**shared, **own}, f"{TABLE}.{MACHINES}.{name}") for name, own in machines.items()}

    def of(self, machine: str) -> LoopConfig:
        """Return the values that hold for a machine."""
        return self._own.get(machine, self.default)

    def healthy_ms(self, machine: str) -> tuple[int, int] | None:
        """Return when somebody has stated that the machine was healthy; None where nobody has."""
        stated = None if self._gap is None else self._gap.of(machine)
        if stated is None or stated.healthy_from is None:
            return None
        from_ms = round(stated.healthy_from.timestamp() * 1000)
        return from_ms, from_ms + round(stated.healthy_hours * 3_600_000)


def loop_configuration(config: Path | None) -> LoopConfiguration:
    """Return what the file of processors says of the loop. Raises ConfigurationError."""
    tables = {} if config is None else read_tables(config)
    return LoopConfiguration(tables.get(TABLE), Configuration(GapConfig, tables.get(GAP), name=GAP))


def _validated(table: Mapping[str, Any], where: str) -> LoopConfig:
    try:
        return LoopConfig.model_validate(table)
    except ValidationError as error:
        raise ConfigurationError("\n".join(table_faults(LoopConfig, error, where))) from None
