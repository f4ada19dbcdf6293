"""Cutting force from spindle load and speed, by the meter of the machine's description: F = P_cut / v_c (twin/live/force.py).

The control's tool number picks the diameter, where the description has the tool. What was assumed is said in
`twin/cutting_force_basis`. Where speed, load or diameter mean nothing, the force is null, with the reason. So it is while the
spindle speeds up or runs down, since its load is its inertia then, and while a meter that holds its peaks still shows one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.description import Description
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.assumed import is_assumed
from twin.live.assumed import SPINDLE, TOOL_DIAMETER_MM, assumed_of, completed
from twin.live.force import SPINDLE_RPM_MIN, LiveForce, ToolUsed
from twin.live.speed import SpindleSpeed
from twin.live.spindle import LiveSpindle
from twin.machine import Machine, MachineFile, SpindleDrive
from twin.vocabulary import twin_signals
from twin.vocabulary.bounds import SPINDLE_LOAD_PCT_MAX, SPINDLE_RPM_MAX

SPEED, COMMAND, LOAD, TOOL = "spindle_rpm", "spindle_rpm_cmd", "spindle_load_pct", "tool_number"
FORCE, BASIS = twin_signals.CUTTING_FORCE_N, twin_signals.CUTTING_FORCE_BASIS
CHANGING = "the spindle changes its speed, or has not been seen to keep it: its load is its inertia, not the cut"
HELD = "the load meter holds a peak: the load of the cut is below what it shows"
_TICK, _DEATH, _HOLE, _GOOD = SampleKind.TICK, SampleKind.DEATH, SampleKind.HOLE, Quality.GOOD
DRIVE_WORDS = {"rated_power_kw": "rated power", "efficiency": "efficiency"}


class Config(ProcessorConfig):
    """The conditions under which a force is given; and, of old, the drive and the tools of a machine that has no description.

    settle_s: the speed has to be steady for so long. A diameter of 0 is an unknown one: the force is null then.
    """

    of_the_machine: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(SpindleDrive.model_fields, "[spindle]"),
        "tool_diameter_mm": "[tool]",
        "tool_diameters_mm": "[tools.N]",
    }

    spindle_rpm_min: PositiveFloat = SPINDLE_RPM_MIN
    settle_s: float = Field(default=1.0, ge=0.0, le=60.0)
    rated_power_kw: PositiveFloat | None = None
    efficiency: float | None = Field(default=None, gt=0.0, le=1.0)
    idle_power_kw: NonNegativeFloat | None = None
    tool_diameter_mm: NonNegativeFloat | None = None
    tool_diameters_mm: dict[str, NonNegativeFloat] = Field(default_factory=dict, description="by tool number")

    @property
    def machine(self) -> MachineFile:
        """The drive by these constants, as far as they go, and marked as assumed where they don't."""
        given = {name: value for name in SpindleDrive.model_fields if (value := getattr(self, name)) is not None}
        assumed = tuple(f"spindle.{name}" for name in SpindleDrive.model_fields if name not in given)
        head = Machine(name="as configured", assumed=(*assumed, *(("tool",) if self.tool_diameter_mm is None else ())))
        return MachineFile(machine=head, spindle=SPINDLE.model_copy(update=given))

    @model_validator(mode="after")
    def _drive_makes_sense(self) -> Self:
        spindle = self.machine.spindle
        assert spindle is not None
        if spindle.idle_power_kw >= spindle.rated_power_kw:
            raise ValueError(f"idle_power_kw is {spindle.idle_power_kw!r}; it has to be from 0 to the rated power")
        return self


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """The drive and the tools of a machine, as the step is given them. machine: whose spindle it is; drive: its basis in words"""

    config: Config
    machine: MachineFile
    force: LiveForce
    drive: str

    def basis(self, tool: ToolUsed) -> str:
        """Return in words what a force on this tool rests on."""
        if tool.diameter_mm is None:
            return self.drive
        path = f"tools.{tool.number}.diameter_mm" if tool.number else "tool.diameter_mm"
        assumed = " (assumed)" if is_assumed(self.machine, path) else ""
        named = f"tool {tool.number} of" if tool.number else "any tool"
        return f"{self.drive}; {named} {tool.diameter_mm:g} mm{assumed}"


def described(config: Config, description: Description | None) -> Described:
    """Return the drive and tools of a machine by its description, else by the old tables, else those that are assumed."""
    machine = config.machine if description is None else completed(description.machine, "spindle")
    spindle = machine.spindle
    assert spindle is not None
    assumed = [DRIVE_WORDS[name] for name in assumed_of(machine, "spindle", DRIVE_WORDS)]
    said = f"{spindle.rated_power_kw:g} kW rated, efficiency {spindle.efficiency:g}"
    said += f" ({' and '.join(assumed)} assumed)" if assumed else ""
    if description is not None:
        said = f"description {description.version}; {said}"
    live = LiveSpindle.of(machine)
    drive = "; ".join((said, *live.in_words))
    if description is None:
        other_mm = TOOL_DIAMETER_MM if config.tool_diameter_mm is None else config.tool_diameter_mm
        return Described(config, machine, LiveForce(live, config.tool_diameters_mm, other_mm, config.spindle_rpm_min), drive)
    force = LiveForce.of(machine, config.spindle_rpm_min)
    if machine.tool is None and not machine.tools:
        head = machine.machine.model_copy(update={"assumed": (*machine.machine.assumed, "tool")})
        machine, force = machine.model_copy(update={"machine": head}), replace(force, other_mm=TOOL_DIAMETER_MM)
    return Described(config, machine, force, drive)


_SPEED_UNSEEN = SpindleSpeed()


@dataclass(frozen=True, slots=True)
class State:
    """The memory of the speed, and of a meter that holds its peaks.

    waits: the force is null for a reason that time ends, so that ticks are looked at
    shown_pct, before_pct: the load shown, and the one that was shown until `changed_s`
    """

    speed: SpindleSpeed = _SPEED_UNSEEN
    waits: bool = False
    shown_pct: float | None = None
    before_pct: float | None = None
    changed_s: float = 0.0


_UNSEEN = State()


def step(given: Described, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """The force as of this sample; at ticks while it waits for the speed or the meter."""
    if sample.kind is _TICK and not state.waits:
        return state, ()
    if sample.kind is _DEATH:
        return _UNSEEN, ()
    if sample.kind is _HOLE:
        state = _UNSEEN
    config = given.config
    tool = given.force.tool(sample.number(TOOL)[0] if given.force.diameters_mm else None)
    basis = _basis(given, tool)
    load_pct, no_load = sample.number(LOAD)
    rpm, no_rpm = sample.number(SPEED)
    if load_pct is None or rpm is None:
        return _UNSEEN, (_null(no_load or no_rpm or ""), basis)
    if abs(rpm) > SPINDLE_RPM_MAX or load_pct > SPINDLE_LOAD_PCT_MAX:
        return _UNSEEN, (_null("spindle_rpm or spindle_load_pct is beyond any spindle"), basis)
    command_rpm = sample.number(COMMAND)[0] if COMMAND in sample.row else None
    speed = state.speed.seen(sample.at_s, rpm, command_rpm, config.settle_s)
    if given.force.spindle.holds:
        state = _shown(state, sample.at_s, load_pct)
    force_n, reason = given.force.force(load_pct, rpm, tool.diameter_mm)
    waits = False
    if force_n is not None and not speed.is_steady(sample.at_s, config.settle_s):
        force_n, reason, waits = None, CHANGING, True
    elif force_n is not None and state.before_pct is not None:
        since_s = sample.at_s - state.changed_s
        if given.force.spindle.is_held(load_pct, rpm, state.before_pct, since_s):
            force_n, reason, waits = None, HELD, True
    if speed is not state.speed or waits is not state.waits:
        state = State(speed, waits, state.shown_pct, state.before_pct, state.changed_s)
    if force_n is None:
        return state, (_null(tool.reason or reason or "" if tool.diameter_mm is None else reason or ""), basis)
    return state, (tuple.__new__(Output, (FORCE, round(force_n, 1), _GOOD, None, None, None)), basis)


def _shown(state: State, at_s: float, load_pct: float) -> State:
    """The state with the load that a meter shows which holds its peaks."""
    if load_pct == state.shown_pct:
        return state
    return replace(state, shown_pct=load_pct, before_pct=state.shown_pct, changed_s=at_s)


@lru_cache(maxsize=1000)
def _basis(given: Described, tool: ToolUsed) -> Output:
    return Output(BASIS, given.basis(tool))


@lru_cache(maxsize=1000)
def _null(why_not: str) -> Output:
    return Output.null(FORCE, why_not)


_DOUBLE, _INFERRED = DataType.DOUBLE, Provenance.INFERRED
PROCESSOR = Processor(
    name="cutting_force",
    version=2,
    inputs=frozenset({SPEED, COMMAND, LOAD, TOOL}),
    outputs=(
        OutputSpec(FORCE, _DOUBLE, "N", "mean tangential cutting force by spindle power", _INFERRED, 0.5, of_challenger=True),
        OutputSpec(BASIS, DataType.STRING, None, "what the force rests on: drive and tool diameter", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    described=described,
)
