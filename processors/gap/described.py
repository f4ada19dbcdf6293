"""The twin of the signals that are compared, worked out of a machine's description once for each description.

A machine that nobody has described has the idle power of processors.toml, where it stands there, and learned baselines.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from processors.description import Description
from processors.gap.config import Config
from processors.gap.signals import LOAD, PROGRAM_TIME, RESOLUTIONS, TEMPERATURE, TOOL_CHANGE
from twin.live.spindle import LiveSpindle
from twin.machine import MachineFile
from twin.motion.quantity import changed_quantity
from twin.vocabulary.program_names import program_key

SECTIONS = {TEMPERATURE: "thermal", LOAD: "spindle", TOOL_CHANGE: "program", PROGRAM_TIME: "program"}
"""The section of a description that the twin of a signal rests on."""

UNTIL_LEARNED = {TEMPERATURE: 0.15}
"""The least floor of a signal before one is learned: the air at a spindle differs so much from that at its thermometer, and no
noise of a sensor says so (`AIR_K` in twin/gap/floors.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Twin:
    """The twin of a machine, as far as it is compared.

    version: of the description, "" where there is none; idle_load_pct: by spindle speed; tool_change_s: with a stopped spindle
    programs: by key, the seconds of each section
    noise: by signal, one standard deviation of its sensor, as the description states it
    assumed: signals whose figures rest on what nobody has stated or fitted; effects: at work, in words
    """

    version: str = ""
    idle_load_pct: Callable[[float], float] | None = None
    tool_change_s: float | None = None
    programs: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    assumed: frozenset[str] = frozenset()
    effects: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """The means of the step: the settings of the watch, and the twin."""

    config: Config
    twin: Twin

    def section_s(self, program: str, section: int) -> float | None:
        """Return how long the twin says that a section of a program takes; None where nobody has planned it."""
        seconds = self.twin.programs.get(program_key(program), ()) if self.twin.programs else ()
        return seconds[section] if section < len(seconds) else None

    def floor_until_learned(self, signal: str) -> float | None:
        """Return the floor that holds before one is learned: what the description says of the sensor, or of the display."""
        noise = self.twin.noise.get(signal)
        return None if noise is None else max(noise, RESOLUTIONS[signal] / math.sqrt(12.0), UNTIL_LEARNED.get(signal, 0.0))


def described(config: Config, description: Description | None) -> Given:
    """Return what the step is given for a machine of this description. Raises TwinError where an effect does not fit it."""
    return Given(config, _undescribed(config) if description is None else _twin(description))


def _undescribed(config: Config) -> Twin:
    idle_kw, rated_kw = config.idle_power_kw, config.rated_power_kw
    if idle_kw is None or rated_kw is None:
        return Twin()
    idle_pct = 100.0 * idle_kw / rated_kw
    return Twin(idle_load_pct=lambda _rpm: idle_pct)


def _twin(description: Description) -> Twin:
    machine = description.machine
    spindle = None if machine.spindle is None else LiveSpindle.of(machine)
    return Twin(
        version=description.version,
        idle_load_pct=None if spindle is None else spindle.idle_load_pct,
        tool_change_s=_tool_change_s(machine),
        programs=description.programs,
        noise={signal: machine.noise[signal] for signal in RESOLUTIONS if machine.noise.get(signal, 0.0) > 0.0},
        assumed=_assumed(description),
        effects=() if spindle is None else spindle.in_words,
    )


def _tool_change_s(machine: MachineFile) -> float | None:
    """The length of a tool change from a stopped spindle on; None where nobody states one."""
    program = machine.program
    if program is None or TOOL_CHANGE not in program.model_fields_set:
        return None
    return changed_quantity(machine, TOOL_CHANGE, program.tool_change_s)


def _assumed(description: Description) -> frozenset[str]:
    """The signals whose section, or a constant of it, is only assumed."""
    sections = {path.partition(".")[0] for path in description.assumed}
    return frozenset(signal for signal, section in SECTIONS.items() if section in sections)
