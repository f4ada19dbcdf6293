"""An expectation worked out: the program planned, its engagement with the stock, and the force of each stretch of each line.

    c = feed · horizontal part / (N n)        F = mean tangential force of the cut at c        (twin.simulator does the same)

Planner, engagement and force are those of the simulator and the optimiser, with the effects of the description, so there is one
physics. Feed of a line is its mean over the time in motion, starts and stops included.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.engagement.along_path import PathRows, engaged_along
from twin.engagement.tool_sections import collision_notes, tool_notes, tool_numbers, tool_sections, tools_used, unknown_start
from twin.errors import EngagementError, MachineError
from twin.expected.basis import Missing, in_words
from twin.expected.expectation import Expectation
from twin.expected.expected import Run
from twin.expected.forces import row_forces
from twin.expected.lines import Numbering, numbering_of, numbers
from twin.expected.meter import Meter
from twin.expected.stretches import stretches_of
from twin.live.spindle import LiveSpindle
from twin.machine import MachineFile, Tool
from twin.motion.path import Kind, Path, path_from_moves
from twin.motion.plan import Plan
from twin.optimisation.program import END_FACE_MM2
from twin.programs import Settings
from twin.programs.called import with_line_elsewhere
from twin.programs.discovery import dialect_of
from twin.programs.fanuc.lathe import lathe_remarks
from twin.programs.remarks import remarks
from twin.programs.source import source_lines
from twin.simulator.simulation import program_plan, program_settings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
PLUNGE = 0.2
"""Steeper than this, 11°, the end face takes so much of the cut that the force of the side says little."""
RUNS_MAX = 400_000
O_WORD = re.compile(r"^\s*([O:]\d+)", re.I)
OUTSIDE = -1
"""The line of what runs in a subprogram that has a text of its own."""


def expectation_of(
    machine: MachineFile,
    program_text: str,
    tools: Mapping[str, Tool] = MappingProxyType({}),
    name: str = "program",
    *,
    numbering: Numbering | None = None,
    settings: Settings | None = None,
    description: str = "",
) -> Expectation:
    """Return what a machine is expected to do in each line of a program.

    tools: by number, in place of those that the machine describes; numbering: of the lines; None = N words where most have them
    description: the version of the machine's description, for `files.py` to tell a stale one

    Raises PartProgramError where a control would refuse the program, MachineError where it cannot be planned, EffectError where
    the effects of the machine do not fit it.
    """
    if tools:
        machine = machine.model_copy(update={"tools": {**machine.tools, **tools}})
    settings = program_settings(machine) if settings is None else settings
    dialect = dialect_of(program_text, settings)
    own = dialect.interpret(program_text, settings)
    moves = with_line_elsewhere(own, OUTSIDE)
    source, block_number = source_lines(program_text), dialect.words.block_number
    numbering = numbering_of(source, block_number) if numbering is None else numbering
    path = path_from_moves(moves, settings.start_mm or None, settings.axes)
    notes: list[str] = [*lathe_remarks(machine.axes)]
    plan = program_plan(machine, path, notes)
    missing = Missing()
    given = _Given.of(machine, path, plan, notes, missing)
    notes = [*remarks(dialect, program_text, own, None if given.rows is None else given.rows.lines_met(path)), *notes]
    told = [*numbers(source, numbering, block_number), OUTSIDE]
    runs = tuple(given.runs(told))
    meter = None
    if machine.spindle is not None:
        spindle = LiveSpindle.of(machine)
        meter = Meter.of(spindle, (run.spindle_rpm for run in runs), 2.0 * machine.spindle.rated_power_kw)
        notes += spindle.in_words
    else:
        missing.add("no [spindle]: no load is expected")
    return Expectation(
        program=name,
        o_word=next((match[1] for one in source if (match := O_WORD.match(one))), ""),
        machine=machine.machine.name,
        numbering=numbering,
        runs=runs,
        meter=meter,
        basis=in_words(machine, numbering, runs, notes, missing),
        program_sha256=text_sha256(program_text),
        description=description,
    )


def text_sha256(text: str) -> str:
    """Return the checksum of a program by its text, ends of lines aside."""
    return hashlib.sha256("\n".join(text.splitlines()).encode()).hexdigest()


@dataclass(frozen=True, slots=True, eq=False)
class _Given:
    """A program along its path. tool: (segments,) index into `tools`, −1 = not described; number: of the tool

    rows: the engagement, None where it is not known, which `why_not` explains
    duration_s: (segments,) in motion; wait_s: standing before and after; rpm: (segments,) signed
    """

    machine: MachineFile
    path: Path
    plan: Plan
    missing: Missing
    number: Ints
    tool: Ints
    tools: Sequence[tuple[int, Tool]]
    rows: PathRows | None
    why_not: str
    rpm: Floats
    wait_s: Floats

    @classmethod
    def of(cls, machine: MachineFile, path: Path, plan: Plan, notes: list[str], missing: Missing) -> "_Given":
        index, tools = tools_used(machine, path)
        notes += tool_notes(machine, path)
        rows, why_not = None, ""
        if machine.stock is None:
            why_not = "no [stock]: what a line cuts is not known"
        elif not tools:
            why_not = "no tool of the program is described: write [tool] or [tools.N]"
        else:
            try:
                rows = engaged_along(path, machine.stock, tool_sections(index, tools, unknown_start(path)))
                notes += collision_notes(path, rows)
            except (EngagementError, MachineError) as error:
                why_not = str(error)
        if why_not:
            missing.add(why_not)
        wait = np.zeros(len(path))
        np.add.at(wait, plan.stretches.first[:-1], plan.wait_s)
        np.add.at(wait, plan.stretches.first[1:] - 1, plan.halt_s)
        return cls(machine, path, plan, missing, tool_numbers(path), index, tools, rows, why_not, path.commanded_rpm(), wait)

    def runs(self, told: Sequence[int]) -> Iterator[Run]:
        """Yield the runs of lines in order: moves and events of one number that follow each other are one run."""
        items = sorted(
            [(event.segment, 0, k, told[event.line]) for k, event in enumerate(self.path.events)]
            + [(k, 1, k, told[line]) for k, line in enumerate(self.path.line.tolist())]
        )
        edges = [0, *(k for k in range(1, len(items)) if items[k][3] != items[k - 1][3]), len(items)]
        if len(edges) > RUNS_MAX:
            raise MachineError(f"the program runs more than {RUNS_MAX} lines; split it")
        forces = None if self.rows is None else row_forces(self.machine, self.path, self.rows, self.tool, self.tools)
        for a, b in pairwise(edges):
            own = items[a:b]
            segments = np.array([k for _, is_move, k, _ in own if is_move], dtype=np.int64)
            events_s = sum(float(self.plan.event_duration_s[k]) for _, is_move, k, _ in own if not is_move)
            yield self._run(own[0][3], own[-1][0], segments, events_s, forces)

    def _run(self, line: int, place: int, segments: Ints, events_s: float, forces: Any) -> Run:
        """Return one run. place: of its last item among the segments, for one that does not move"""
        path, plan = self.path, self.plan
        here = segments[-1] if len(segments) else min(place, len(path) - 1)
        rpm, number = (float(self.rpm[here]), int(self.number[here])) if len(path) else (0.0, 0)
        length, moving_s = path.length_mm[segments], plan.duration_s[segments]
        feeds = path.kind[segments] != Kind.RAPID
        counted = feeds if feeds.any() else np.ones(len(segments), dtype=np.bool_)
        seconds = float(moving_s[counted].sum())
        feed = 60.0 * float(length[counted].sum()) / seconds if seconds > 0.0 else 0.0
        cutting = segments[feeds]
        why_not = self._why_not(cutting) if len(cutting) else ""
        if why_not:
            self.missing.add(why_not, line)
        tool = self.tool[segments[feeds][-1]] if len(cutting) else -1
        diameter = self.tools[tool][1].diameter_mm if tool >= 0 else 0.0
        return Run(
            line=line,
            tool=number,
            feed_mm_min=feed,
            spindle_rpm=abs(rpm),
            diameter_mm=diameter,
            length_mm=float(length.sum()),
            time_s=float(moving_s.sum() + self.wait_s[segments].sum()) + events_s,
            stretches=() if why_not else stretches_of(forces, segments, length, feeds, feed, abs(rpm)),
            why_not=why_not,
        )

    def _why_not(self, cutting: Ints) -> str:
        """Return why the force on these segments, which feed, is not known; empty = it is."""
        if self.rows is None:
            return self.why_not
        tools = set(self.tool[cutting].tolist())
        if -1 in tools:
            unknown = sorted({int(n) for n, index in zip(self.number[cutting], self.tool[cutting], strict=True) if index < 0})
            return (
                f"tool {unknown[0]} is not described: write [tools.{unknown[0]}] if it is an end mill; a drill or a tap has no "
                "load in any case"
            )
        rows = np.concatenate([np.arange(self.rows.first[s], self.rows.first[s + 1]) for s in cutting.tolist()])
        own = self.rows.segment[rows]
        start, end = self.path.tip_ends_mm(own)
        down = np.maximum(start[:, 2] - end[:, 2], 0.0) > PLUNGE * self.path.length_mm[own]
        if bool((down & (self.rows.end_face_mm2[rows] > END_FACE_MM2)).any()):
            return "down into material, and the formula of the force has no end face"
        if bool((self.rows.axial_depth_mm[rows] > 0.0).any()) and bool((self.rpm[cutting] <= 0.0).any()):
            return "a cut with the spindle at rest or backwards"
        return ""
