"""`machine.toml`: what the twin is told about a machine (formats, section 4). Typed, frozen, checked before anything runs.

A section that a machine has no data for is None; what needs it says so. Values that a control knows by another name keep that
name in their description. A machine is written back as the same TOML, so that an identified machine is a file like any other.
"""

import math
import tomllib
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator

from twin.assumption import Assumption, checked, with_assumptions
from twin.errors import MachineError
from twin.learned.section import LEARNED, LearnedSection
from twin.machine_control import ControlSection
from twin.programs import Settings
from twin.rotary import outside_name, outside_path, outside_text
from twin.rotary_tables import tables_inside
from twin.vocabulary.faults import faults_of, report

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
ByDirection = NotNegative | tuple[NotNegative, NotNegative]
"""A figure, or [moving in -, moving in +]."""


class Section(BaseModel):
    """A table of the file: nothing but the keys that exist, nothing changed after it was read."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Machine(Section):
    """[machine]: its name, the period at which position and velocity loop tick, and what of the file is only assumed.

    assumed: sections and constants that nobody has stated or fitted, by path: `thermal`, `spindle.efficiency`; those of
    [assumed] too
    """

    name: str = Field(min_length=1)
    servo_period_s: Positive = 0.001
    assumed: tuple[Annotated[str, Field(min_length=1)], ...] = ()


class Friction(Section):
    """[axes.a.friction]: F = sgn(v) [F_c + (F_s − F_c) exp(−(v/v_s)²)] + μ v, each constant for both directions or [−, +]."""

    coulomb_n: ByDirection
    static_n: ByDirection
    stribeck_velocity_mm_s: Positive | tuple[Positive, Positive]
    viscous_n_s_per_mm: ByDirection = 0.0

    @model_validator(mode="after")
    def _static_is_not_below_coulomb(self) -> Self:
        for side in (0, 1):
            if by_side(self.static_n, side) < by_side(self.coulomb_n, side):
                raise ValueError(
                    f"static_n {self.static_n} is below coulomb_n {self.coulomb_n}; friction at rest is not the smaller one"
                )
        return self


def by_side(value: float | tuple[float, float], side: int) -> float:
    """The figure for moving in − (side 0) or in + (side 1)."""
    return value[side] if isinstance(value, tuple) else value


class Axis(Section):
    """[axes.a]: feed drive and servo loops. The force of a torque command comes from the screw or is stated as such.

    A rotary axis is stated in degrees and N m, and is here as a point on it is that moves 1 mm for each degree, with forces and
    masses in units of its `scale` (`twin.rotary`).
    """

    mass_kg: Positive
    screw_lead_mm: Positive | None = None
    torque_constant_nm_per_a: Positive | None = None
    force_per_command_n: Positive | None = None
    position_gain_per_s: Positive
    velocity_gain_a_s_per_mm: Positive
    velocity_integral_gain_a_per_mm: NotNegative = 0.0
    torque_limit_a: Positive
    friction: Friction
    scale: Positive | None = Field(default=None, exclude=True)

    @model_validator(mode="after")
    def _force_is_known_once(self) -> Self:
        if self.is_rotary and self.force_per_command_n is None:
            raise ValueError("state torque_per_command_nm")
        screw = self.screw_lead_mm is not None and self.torque_constant_nm_per_a is not None
        if (self.force_per_command_n is None) != screw:
            raise ValueError("state either force_per_command_n, or screw_lead_mm with torque_constant_nm_per_a")
        return self

    @property
    def is_rotary(self) -> bool:
        """Return True where it turns."""
        return self.scale is not None

    @property
    def newton_per_command(self) -> float:
        """Force of one unit of torque command, N: k_t · 2π / lead, or as stated.

        A torque of 1.2 N·m on a lead of 12 mm: 1.2 · 2π / 0.012 m = 628.3 N.
        """
        if self.force_per_command_n is not None:
            return self.force_per_command_n
        assert self.torque_constant_nm_per_a is not None and self.screw_lead_mm is not None
        return self.torque_constant_nm_per_a * 2.0 * math.pi / (self.screw_lead_mm / 1000.0)


class Mode(Section):
    """[[tool.modes]]: one mode of the tip of the tool in its holder and spindle, as a tap test gives it.

    k G(ω) = 1 / (1 − (ω/ω_n)² + 2 i ζ ω/ω_n) in machine direction x or y; modes of one direction add up.
    """

    direction: Annotated[str, Field(pattern=r"^[xy]$")]
    frequency_hz: Positive
    damping_ratio: Annotated[float, Field(gt=0, lt=1)]
    stiffness_n_per_mm: Positive


class Tool(Section):
    """[tool]: an end mill without helix; K_t and K_e = F_r / F_t of the material it cuts; its modes, where they are known."""

    diameter_mm: Positive
    teeth: Annotated[int, Field(ge=1)]
    tangential_coefficient_n_per_mm2: Positive
    radial_ratio: NotNegative
    modes: tuple[Mode, ...] = ()


class SpindleDrive(Section):
    """[spindle]: what 100 % load means, which part reaches the tool, what it takes to turn in air."""

    rated_power_kw: Positive
    efficiency: Annotated[float, Field(gt=0, le=1)]
    idle_power_kw: NotNegative = 0.0


class Thermal(Section):
    """[thermal]: C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R."""

    alpha_w_per_pct_rpm2: NotNegative
    beta_w_per_rpm: NotNegative
    resistance_k_per_w: Positive
    capacity_j_per_k: Positive


class Program(Section):
    """[program]: how long a program takes. What is left out is no limit and takes no time.

    Beyond those of formats, section 4, with FANUC's numbers: rapid_acceleration_mm_s2 (1620; else as in cutting feed),
    centripetal_mm_s2 on arcs (1735; else as the axes), corner_deviation_mm (contour tolerance), in_position_s (wait at each
    halt, 1826), spindle_deceleration_rpm_s, spindle_base_rpm (above it power is constant), rapid_waits_for_spindle,
    rapid_overlap (1722)
    """

    rapid_mm_min: Positive
    acceleration_mm_s2: Positive
    jerk_mm_s3: Positive | None = None
    corner_speed_difference_mm_min: NotNegative = 0.0
    block_time_s: NotNegative = 0.0
    tool_change_s: NotNegative = 0.0
    spindle_acceleration_rpm_s: Positive | None = None
    rapid_acceleration_mm_s2: Positive | None = None
    centripetal_mm_s2: Positive | None = None
    corner_deviation_mm: Positive | None = None
    in_position_s: NotNegative = 0.0
    spindle_deceleration_rpm_s: Positive | None = None
    spindle_base_rpm: Positive | None = None
    rapid_waits_for_spindle: bool = False
    rapid_overlap: bool = False


class Limits(Section):
    """[limits]: for the optimiser. Pairs are [lowest, highest]; what is left out is no limit.

    force_n: greatest resultant over a tooth period; power_kw: electrical, of the spindle drive (else what [spindle] has)
    torque_nm: on the spindle, mean over a turn; chip_mm: greatest chip thickness on the engaged arc
    surface_speed_m_min: of the edge
    """

    feed_mm_min: tuple[Positive, Positive]
    spindle_rpm: tuple[Positive, Positive]
    force_n: Positive | None = None
    power_kw: Positive | None = None
    torque_nm: Positive | None = None
    chip_mm: tuple[NotNegative, Positive] | None = None
    surface_speed_m_min: tuple[NotNegative, Positive] | None = None

    @model_validator(mode="after")
    def _lowest_is_not_above_highest(self) -> Self:
        for name in ("feed_mm_min", "spindle_rpm", "chip_mm", "surface_speed_m_min"):
            pair = getattr(self, name)
            if pair is not None and pair[0] > pair[1]:
                raise ValueError(f"{name} {list(pair)} has its lowest above its highest")
        return self


class ToolWears(StrEnum):
    """While what the tool's life runs."""

    IN_PROGRAM = "in_program"
    """All the time that the program takes, as in the reference paper (Eq. 20 with T_p)."""
    IN_CUT = "in_cut"
    """While the edge cuts."""


class Cost(Section):
    """[cost]: tool life by Taylor, V Tⁿ = C with T in min, and what a second costs."""

    currency: str
    tool_price: NotNegative
    tool_change_s: NotNegative
    labour_per_s: NotNegative
    depreciation_per_s: NotNegative
    taylor_c_m_per_min: Positive
    taylor_n: Positive
    tool_wears: ToolWears = ToolWears.IN_PROGRAM


class Stock(Section):
    """[stock]: the box that is cut from, in machine coordinates."""

    min_mm: tuple[Finite, Finite, Finite]
    max_mm: tuple[Finite, Finite, Finite]

    @model_validator(mode="after")
    def _is_a_box(self) -> Self:
        for axis, low, high in zip("xyz", self.min_mm, self.max_mm, strict=True):
            if not low < high:
                raise ValueError(f"min_mm {low} is not below max_mm {high} in {axis}")
        return self


class AddedEffect(Section):
    """[[effects]]: an effect that was added to this twin, where it acts, and its parameters."""

    effect: str
    on: str = ""
    parameters: dict[str, float] = Field(default_factory=dict)


class MachineFile(Section):
    """The whole file."""

    machine: Machine
    axes: dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9]?$")], Axis] = Field(default_factory=dict)
    tool: Tool | None = None
    tools: dict[Annotated[str, Field(pattern=r"^[0-9]{1,8}$")], Tool] = Field(default_factory=dict)
    spindle: SpindleDrive | None = None
    thermal: Thermal | None = None
    program: Program | None = None
    control: ControlSection = ControlSection()
    limits: Limits | None = None
    cost: Cost | None = None
    stock: Stock | None = None
    uncertainty: dict[str, NotNegative] = Field(default_factory=lambda: {"relative": 0.05})
    noise: dict[str, NotNegative] = Field(default_factory=dict)
    effects: tuple[AddedEffect, ...] = ()
    learned: tuple[LearnedSection, ...] = ()
    assumed: dict[str, Assumption] = Field(default_factory=dict)

    @field_validator("assumed")
    @classmethod
    def _assumptions_are_of_what_is_stated(cls, given: dict[str, Assumption], info: ValidationInfo) -> dict[str, Assumption]:
        """Check what is assumed in sections that are right; in one with a fault of its own nothing is known to be stated."""
        wrong = cls.model_fields.keys() - info.data.keys()
        checked({path: one for path, one in given.items() if path.partition(".")[0] not in wrong}, info.data)
        return given

    @model_validator(mode="before")
    @classmethod
    def _assumptions_count_everywhere(cls, given: Any) -> Any:
        return with_assumptions(given) if isinstance(given, dict) else given

    @model_validator(mode="before")
    @classmethod
    def _learned_terms_stand_apart(cls, given: Any) -> Any:
        """Take the learned terms out of [[effects]]: whatever goes through the effects finds those of the catalogue only."""
        if not isinstance(given, dict) or not isinstance(given.get("effects"), list | tuple):
            return given
        learned = [entry for entry in given["effects"] if _is_learned(entry)]
        return given | {
            "effects": [entry for entry in given["effects"] if not _is_learned(entry)],
            "learned": [*given.get("learned", ()), *learned],
        }

    @property
    def rotary(self) -> dict[str, float]:
        """Letters of the rotary axes, each with the scale of its forces and masses."""
        return {letter: axis.scale for letter, axis in self.axes.items() if axis.scale is not None}

    @property
    def words(self) -> tuple[str, ...]:
        """Letters of the axes that a program of the machine can have words for: x, y, z, and its rotary ones among a, b, c."""
        return ("x", "y", "z", *sorted(self.rotary.keys() & {"a", "b", "c"}))

    def with_tool(self, number: str) -> Self:
        """The machine with tool `number` in its spindle: as [tool], with what is known of it and the effects on it.

        The same where no [tools.N] describes it.
        """
        if number not in self.tools:
            return self
        mine = tuple(
            e.model_copy(update={"on": ""}) if e.on == number else e
            for e in self.effects
            if e.on not in self.tools or e.on == number
        )
        known = {path.replace(f"tools.{number}.", "tool."): v for path, v in self.uncertainty.items()}
        return self.model_copy(update={"tool": self.tools[number], "effects": mine, "uncertainty": known})

    @property
    def settings(self) -> Settings:
        """The settings with which the control reads a program: [control]."""
        return self.control.settings()


def machine_from_toml(text: str, source: str = "machine.toml") -> MachineFile:
    """The machine that `text` describes.

    Raises MachineError naming source, key, value and what would be right, with a line for each fault.
    """
    raw: dict[str, Any] = {}
    try:
        raw = tomllib.loads(text)
        if LEARNED in raw:
            raise MachineError(f'{LEARNED} is not known; a learned term is one of [[effects]], with effect = "{LEARNED}"')
        return MachineFile.model_validate(tables_inside(raw))
    except tomllib.TOMLDecodeError as error:
        raise MachineError(f"{source}: is not TOML: {error}") from None
    except ValidationError as error:
        faults = [fault | {"loc": _in_file(fault["loc"], raw)} for fault in _as_written(raw, error)]
        raise MachineError(report(source, faults_of(faults, MachineFile), "docs/reference/machine.md")) from None
    except MachineError as error:
        raise MachineError(f"{source}: {error}") from None


def _as_written(tables: dict[str, Any], error: ValidationError) -> list[dict[str, Any]]:
    """The faults of a file, those of rotary axes with the names and figures that the file has."""
    written = tables_inside(tables, scaled=False)
    try:
        MachineFile.model_validate(written)
    except ValidationError as unscaled:
        error = unscaled
    faults: list[dict[str, Any]] = [dict(fault) for fault in error.errors(include_url=False)]
    rotary = {letter: 1.0 for letter, axis in written.get("axes", {}).items() if isinstance(axis, dict) and "scale" in axis}
    for fault in faults:
        place = fault["loc"]
        if place[:1] == ("assumed",):
            fault["loc"] = tuple(outside_path(str(part), rotary) for part in place)
            fault["msg"] = outside_text(fault["msg"], rotary, ())
        if len(place) > 1 and place[0] == "axes" and "scale" in written["axes"].get(place[1], ()):
            fault["loc"] = (*place[:-1], outside_name(str(place[-1]))[0])
            fault["msg"] = outside_text(fault["msg"], {str(place[1]): 1.0}, ())
    return faults


def _is_learned(entry: Any) -> bool:
    return isinstance(entry, LearnedSection) or (isinstance(entry, dict) and entry.get("effect") == LEARNED)


def _in_file(place: tuple[int | str, ...], raw: dict[str, Any]) -> tuple[int | str, ...]:
    """The place of a fault as the file counts: learned terms stand among the effects there."""
    if len(place) < 2 or place[0] not in ("effects", LEARNED) or not isinstance(place[1], int):
        return place
    alike = [number for number, entry in enumerate(raw["effects"]) if _is_learned(entry) is (place[0] == LEARNED)]
    return ("effects", alike[place[1]], *place[2:])


def read_machine(path: Path) -> MachineFile:
    """The machine in the file `path`. Raises MachineError where there is none or it does not describe a machine."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise MachineError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise MachineError(f"{path}: cannot be read: {error}") from None
    return machine_from_toml(text, str(path))
