"""The twin, computed again from what a machine told: where the store does not have what it said, and over run logs.

The physics is that of the live twin: the machine's description, with every effect of it; without one, the constants in the old
tables [thermal] and [cutting_force] of the processors' configuration.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cnctwin.validation.evidence import AMBIENT, COOLANT, LOAD, SPEED, TEMPERATURE, TOOL, Evidence
from cnctwin.validation.track import Floats, Grid, averaged, held
from processors import cutting_force as force_processor
from processors import thermal as thermal_processor
from processors.config import Configuration
from processors.description import Description
from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.learned.standing import on_axes
from twin.live.speed import SpindleSpeed
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.simulator.recorded import told_of
from twin.simulator.response import RunInput, respond


@dataclass(frozen=True, slots=True, eq=False)
class Twin:
    """The twin as far as it is known. file: the machine's description; tables: of the processors' configuration"""

    file: MachineFile | None
    tables: Mapping[str, Mapping[str, Any]]

    def heat(self, machine: str) -> MachineFile | None:
        """A machine as far as its heat goes; None where nothing states it."""
        if self.file is not None and self.file.thermal is not None:
            return _without_axes(self.file)
        if "thermal" not in self.tables:
            return None
        return self._thermal(machine).machine

    def _thermal(self, machine: str) -> thermal_processor.Config:
        return Configuration(thermal_processor.Config, self.tables.get("thermal"), name="thermal").of(machine)

    def ambient_c(self, machine: str) -> float | None:
        """Return the temperature of the surroundings, where no signal tells it."""
        return self._thermal(machine).ambient_temp_c

    def force(self, machine: str) -> force_processor.Described | None:
        """Drive and tools by spindle power; None where nothing states them."""
        table, file = self.tables.get("cutting_force"), self.file
        config = Configuration(force_processor.Config, table, name="cutting_force").of(machine)
        if file is not None and file.spindle is not None and (file.tool is not None or file.tools):
            return force_processor.described(config, Description(file, FILE))
        return None if table is None else force_processor.described(config, None)


FILE = "machine.toml"
"""The name of the description in a basis."""


def _without_axes(machine: MachineFile) -> MachineFile:
    effects = tuple(e for e in machine.effects if effect_named(e.effect).on is not On.AXIS)
    kept = {"effects": tuple(e for e in effects if not e.on.endswith(("_mm", "_torque_a")))}
    return machine.model_copy(update={"axes": {}, "learned": on_axes(machine.learned, ())} | kept)


def temperature(twin: Twin, evidence: Evidence, grid: Grid, held_s: float) -> tuple[Floats, str]:
    """The spindle's temperature (count,) in each window, and what it rests on; raises LookupError with the reason for none.

    It runs freely from the first moment at which speed and load are known, begun with the temperature measured then; where one of
    them is not known, it is not judged, and bridged with what was known last.
    """
    machine = twin.heat(evidence.machine)
    if machine is None:
        raise LookupError("nothing states the spindle's heat: [thermal] of machine.toml, or of the processors' configuration")
    if not evidence.knows(SPEED, LOAD):
        raise LookupError(f"{SPEED} and {LOAD} are not recorded")
    rpm, load = (_input(evidence, name, grid, held_s) for name in (SPEED, LOAD))
    known = np.isfinite(rpm) & np.isfinite(load)
    ambient, basis = _ambient(twin, evidence, grid, held_s)
    if not known.any() or grid.count < 2:
        raise LookupError(f"{SPEED} and {LOAD} are never known together")
    first = int(np.argmax(known))
    measured = held(evidence.told.get(TEMPERATURE), grid, held_s)
    begun = measured[first:][np.isfinite(measured[first:])]
    start_c = float(begun[0]) if len(begun) and np.isfinite(measured[first]) else None
    coolant = _input(evidence, COOLANT, grid, held_s)
    run = RunInput(
        t_s=grid.starts_s[first:] - grid.starts_s[first],
        spindle_rpm=_bridged(rpm[first:]),
        coolant_on=np.nan_to_num(coolant[first:]) if np.isfinite(coolant).any() else None,
        ambient_temp_c=_bridged(ambient[first:]),
        start_temp_c=start_c,
    )
    answer = respond(machine, run, recorded={LOAD: _bridged(load[first:])}).columns[TEMPERATURE]
    found = np.full(grid.count, np.nan)
    found[first:] = np.where(known[first:], answer, np.nan)
    start = "the measured temperature" if start_c is not None else "ambient"
    return found, f"computed from {SPEED} and {LOAD}, begun with {start}; ambient {basis}"


def _input(evidence: Evidence, name: str, grid: Grid, held_s: float) -> Floats:
    """Window means; between two tellings what was told last."""
    means = averaged(evidence.told.get(name), grid)
    return np.where(np.isfinite(means), means, held(evidence.told.get(name), grid, held_s))


def _ambient(twin: Twin, evidence: Evidence, grid: Grid, held_s: float) -> tuple[Floats, str]:
    measured = _input(evidence, AMBIENT, grid, held_s)
    if np.isfinite(measured).any():
        return measured, "measured"
    configured_c = twin.ambient_c(evidence.machine)
    if configured_c is not None:
        return np.full(grid.count, configured_c), "configured"
    raise LookupError(f"{AMBIENT} is neither recorded nor configured")


def _bridged(values: Floats) -> Floats:
    """With what was known last where nothing is; before the first, that."""
    there = np.isfinite(values)
    if not there.any():
        return np.zeros_like(values)
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), int(np.argmax(there))))
    return np.asarray(values[last])


def power_force(twin: Twin, evidence: Evidence, grid: Grid, held_s: float) -> tuple[Floats, str]:
    """The mean tangential force (count,) by spindle power; raises LookupError with the reason for none."""
    given = twin.force(evidence.machine)
    if given is None:
        raise LookupError(
            "nothing states the drive: [spindle] and [tool] of machine.toml, or [cutting_force] of the configuration"
        )
    if not evidence.knows(SPEED, LOAD):
        raise LookupError(f"{SPEED} and {LOAD} are not recorded")
    rpm, load = (_input(evidence, name, grid, held_s) for name in (SPEED, LOAD))
    tool = held(evidence.told.get(TOOL), grid, np.inf)
    force, speed, settle_s = np.full(grid.count, np.nan), SpindleSpeed(), given.config.settle_s
    for place, at_s in enumerate(grid.starts_s.tolist()):
        if not np.isfinite(rpm[place]):
            speed = SpindleSpeed()
            continue
        speed = speed.seen(at_s, float(rpm[place]), None, settle_s)
        if speed.is_steady(at_s, settle_s):
            number = None if np.isnan(tool[place]) else float(tool[place])
            found = given.force.force(float(load[place]), float(rpm[place]), given.force.tool(number).diameter_mm)
            force[place] = np.nan if found.force_n is None else found.force_n
    return force, f"by spindle power: {given.drive}"


def milling_force(machine: MachineFile, log: RunLog) -> Floats | None:
    """The force across the tool (n,) by the milling model, where the run tells the cut; else None."""
    cut = ("axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "spindle_rpm", "spindle_angle_rad", "x_ref_mm", "y_ref_mm")
    if machine.tool is None or not log.has(*cut):
        return None
    columns = respond(_without_axes(machine), told_of(log, machine)).columns
    if "force_x_n" not in columns:
        return None
    return np.asarray(np.hypot(columns["force_x_n"], columns["force_y_n"]))
