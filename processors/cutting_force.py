"""Cutting force from spindle load and speed: F = load · P_rated · η / v_c (twin.cutting).

The control's tool number picks the diameter, where the configuration lists it; otherwise one diameter holds for all tools.
What was assumed is said in `twin/cutting_force_basis`. Where speed, load or diameter mean nothing, the force is null, with the
reason.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.contract import NoState, Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.cutting import SpindleDrive, cutting_force
from twin.vocabulary import twin_signals
from twin.vocabulary.bounds import SPINDLE_LOAD_PCT_MAX, SPINDLE_RPM_MAX

SPEED, LOAD, TOOL = "spindle_rpm", "spindle_load_pct", "tool_number"
FORCE, BASIS = twin_signals.CUTTING_FORCE_N, twin_signals.CUTTING_FORCE_BASIS
_TICK, _DEATH, _GOOD = SampleKind.TICK, SampleKind.DEATH, Quality.GOOD
DRIVE_FIELDS = {"rated power": "rated_power_kw", "efficiency": "efficiency"}


class Config(ProcessorConfig):
    """The drive and the tools. A diameter of 0 is an unknown one: the force is null then."""

    rated_power_kw: PositiveFloat = 15.0
    efficiency: float = Field(default=0.85, gt=0.0, le=1.0)
    idle_power_kw: NonNegativeFloat = 0.0
    spindle_rpm_min: PositiveFloat = 50.0
    tool_diameter_mm: NonNegativeFloat = 12.0
    tool_diameters_mm: dict[str, NonNegativeFloat] = Field(default_factory=dict, description="by tool number")

    @cached_property
    def drive(self) -> SpindleDrive:
        """The drive as the physics takes it."""
        return SpindleDrive(self.rated_power_kw, self.efficiency, self.idle_power_kw, self.spindle_rpm_min)

    @cached_property
    def drive_basis(self) -> str:
        """The drive in words, and what of it nobody has configured."""
        known = f"{self.rated_power_kw:g} kW rated, efficiency {self.efficiency:g}"
        assumed = [name for name in ("rated power", "efficiency") if DRIVE_FIELDS[name] not in self.model_fields_set]
        return f"{known} ({' and '.join(assumed)} assumed)" if assumed else known

    @cached_property
    def any_tool_basis(self) -> str:
        """The drive, and the diameter that is taken for tools that are not listed."""
        assumed = "" if "tool_diameter_mm" in self.model_fields_set else " (assumed)"
        return f"{self.drive_basis}; any tool {self.tool_diameter_mm:g} mm{assumed}"

    @model_validator(mode="after")
    def _drive_makes_sense(self) -> Self:
        _ = self.drive
        return self


def step(config: Config, state: NoState, sample: Sample) -> tuple[NoState, Sequence[Output]]:
    """The force as of this sample."""
    if sample.kind is _TICK or sample.kind is _DEATH:
        return state, ()
    diameter_mm, basis = _diameter(config, sample)
    load_pct, no_load = sample.number(LOAD)
    rpm, no_rpm = sample.number(SPEED)
    if load_pct is None or rpm is None:
        return state, _unknown(no_load or no_rpm or "", basis)
    if abs(rpm) > SPINDLE_RPM_MAX or load_pct > SPINDLE_LOAD_PCT_MAX:
        return state, _unknown("spindle_rpm or spindle_load_pct is beyond any spindle", basis)
    force_n, reason = cutting_force(config.drive, load_pct, rpm, diameter_mm)
    if force_n is None:
        return state, _unknown(reason or "", basis)
    return state, (tuple.__new__(Output, (FORCE, round(force_n, 1), _GOOD, None, None, None)), _basis(basis))


@lru_cache(maxsize=1000)
def _basis(basis: str) -> Output:
    return Output(BASIS, basis)


@lru_cache(maxsize=1000)
def _unknown(why_not: str, basis: str) -> tuple[Output, Output]:
    return Output.null(FORCE, why_not), _basis(basis)


def _diameter(config: Config, sample: Sample) -> tuple[float, str]:
    """The diameter, and in words what the figure rests on."""
    if config.tool_diameters_mm:
        tool, _ = sample.number(TOOL)
        listed = None if tool is None else config.tool_diameters_mm.get(f"{tool:.0f}")
        if listed is not None:
            return listed, f"{config.drive_basis}; tool {tool:.0f} of {listed:g} mm"
    return config.tool_diameter_mm, config.any_tool_basis


PROCESSOR = Processor(
    name="cutting_force",
    version=1,
    inputs=frozenset({SPEED, LOAD, TOOL}),
    outputs=(
        OutputSpec(FORCE, DataType.DOUBLE, "N", "mean tangential cutting force by spindle power", Provenance.INFERRED, 0.5),
        OutputSpec(BASIS, DataType.STRING, None, "what the force rests on: drive and tool diameter", Provenance.INFERRED),
    ),
    config=Config,
    state=NoState,
    initial=lambda _: NoState(),
    step=step,
)
