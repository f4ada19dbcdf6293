"""The text of the milling kernels: forces tick by tick, and their peak over a tooth period.

A lane is one candidate tool and material; W lanes go over the same motion side by side, so angles and sines are worked out once
for all of them. Constants lie in one flat array, `constants[k * W + lane]`.

The mean over a tick is a Gauss-Legendre quadrature (4 nodes, 7th degree) over the angle that a tooth turns within the engaged
arc, in pieces of at most 0.9 rad, so that a jump at exit falls between two pieces: good to 1e-7 of the force.

Where the edge has a lag (`helix`), what stands in the cut at a moment is a stretch of angles as long as the lag, and what passes
in a tick is that stretch on the move: the force at the tick is the mean of f(φ) over it, and the mean over the tick that of f(φ)
under a trapezium, (depth / (lag · turn)) ∫ f(φ) overlap(φ) dφ. Both go through the same quadrature, so there are no slices.
"""

from dataclasses import dataclass
from functools import cache

from twin.effects.effect import Effect
from twin.kernels.assembly import KERNEL, Assembly, kernel_text
from twin.kernels.weave import Woven, function_text, weave
from twin.process import angle, tooth
from twin.process.peak import AT, EVENTS, PEAK
from twin.process.quadrature import NODES, NOTHING_KEPT, PASSED, STRETCHES, WEIGHTS, WINDOWS, indented

AT_TICK = ("spindle_rpm", "speed_mm_s", "axial_depth_mm")
"""Quantities of the tick that an effect may ask for beside those of the tooth."""
CUT = Assembly((tooth.radius, tooth.lag, tooth.tooth_force), acts_on="the cut", owner="the cut")


def process_quantities() -> dict[str, str]:
    """The quantities of the cut that an effect can change, with their sites."""
    return CUT.quantities()


@dataclass(frozen=True, slots=True)
class MillingKernel:
    """Generated text that defines `milling`, `peak` and, where it is stepped, `radii`.

    constants: that it takes, in the order of their rows; stepped: whether teeth may run on unequal radii
    """

    text: str
    constants: tuple[str, ...]
    stepped: bool


@cache
def milling_kernel(lanes: int, effects: tuple[Effect, ...] = ()) -> MillingKernel:
    """The kernels with these effects, for `lanes` lanes side by side; one lane where the edge has a lag.

    What no effect asks for (unequal radii, a lag) is not in the text.
    """
    given = {"tooth_rad", "advance_mm", "sine", "cosine", "radius_step_mm", *AT_TICK}
    radius, lag, force = (weave((physics,), effects) for physics in CUT.physics)
    stages = (radius, lag, force) if _lagging(effects) else (radius, force)
    taken = dict.fromkeys(name for stage in stages for name in stage.takes if name not in given)
    layout = _Layout(lanes, tuple(taken), "radius_step_mm" in _asked(force, effects), _lagging(effects), radius, lag, force)
    functions = [angle.wrapped, angle.small_sine, angle.small_cosine]
    texts = [function_text(function) for function in functions]
    texts += list(dict.fromkeys(text for stage in stages for text in stage.functions))
    head = "from math import atan2, cos, exp, floor, sin, sqrt, tan"
    kernels = [*([layout.radii()] if layout.stepped else []), layout.milling(), layout.peak()]
    return MillingKernel(kernel_text(head, texts, kernels), layout.constants, layout.stepped)


def _lagging(effects: tuple[Effect, ...]) -> bool:
    return any("lag_rad" in effect.changes for effect in effects)


def _asked(force: Woven, effects: tuple[Effect, ...]) -> set[str]:
    return set(force.takes) if any("tooth_radius_mm" in effect.changes for effect in effects) else set()


@dataclass(frozen=True, slots=True)
class _Layout:
    """Writes the kernels around the woven physics."""

    lanes: int
    constants: tuple[str, ...]
    stepped: bool
    lagging: bool
    radius: Woven
    lag: Woven
    force: Woven

    def _read(self, stage: Woven) -> list[str]:
        rows = {name: row for row, name in enumerate(self.constants)}
        return [f"{name} = constants[{rows[name] * self.lanes} + lane]" for name in stage.takes if name in rows]

    def _forces(self, sine: str, cosine: str) -> list[str]:
        """The woven force at an angle, for the lane and tooth at hand."""
        stepped = [f"radius_step_mm = radius_steps_mm[tooth * {self.lanes} + lane]"] if self.stepped else []
        return [f"sine = {sine}", f"cosine = {cosine}", *self._read(self.force), *stepped, *self.force.body.splitlines()]

    def _lag(self) -> list[str]:
        """The lag of the edge at the whole depth; 0 where it has none."""
        return ["lane = 0", *self._read(self.lag), *self.lag.body.splitlines()] if self.lagging else []

    def radii(self) -> str:
        """By how much the radius of each tooth exceeds that of the one before: `radii(teeth, constants, radius_steps_mm)`."""
        lines = [
            KERNEL,
            "def radii(teeth, constants, radius_steps_mm):",
            *indented([f"for lane in range({self.lanes}):", "    for tooth in range(teeth):"], 1),
            *indented(["tooth_rad = 6.283185307179586 * tooth / teeth", *self._read(self.radius)], 3),
            *indented([*self.radius.body.splitlines(), "own_mm = tooth_radius_mm"], 3),
            *indented(["tooth_rad = 6.283185307179586 * (tooth - 1) / teeth", *self.radius.body.splitlines()], 3),
            *indented([f"radius_steps_mm[tooth * {self.lanes} + lane] = own_mm - tooth_radius_mm"], 3),
        ]
        return "\n".join(lines)

    def milling(self) -> str:
        """Forces at each tick and their means until the next one, into `outputs[(row * ticks + tick) * stride + first + lane]`.

        Rows: force in x and y at the tick, mean force in x and y, mean tangential force of all teeth.
        """
        width = self.lanes
        rows = [f"work[{row * width} + lane] * axial_depth_mm{'' if row < 3 else ' * per_turn'}" for row in (0, 1, 3, 4, 5)]
        lines = [
            KERNEL,
            "def milling(ticks, teeth, period_s, constants, radius_steps_mm, work, spindle_angle_rad, spindle_rpm_in,",
            "            velocity_x_mm_s, velocity_y_mm_s, axial_depth_mm_in, entry_angle_rad, exit_angle_rad,",
            "            outputs, first, stride):",
            *indented(["pitch_rad = 6.283185307179586 / teeth", *NOTHING_KEPT], 1),
            *indented(["for tooth in range(teeth):", f"    work[{6 * width} + 2 * tooth] = sin(tooth * pitch_rad)"], 1),
            f"        work[{6 * width} + 2 * tooth + 1] = cos(tooth * pitch_rad)",
            "    for tick in range(ticks):",
            *indented(_TICK, 2),
            *indented([f"for cell in range({6 * width}):", "    work[cell] = 0.0", *self._lag(), *self._passing()], 3),
            f"            for lane in range({width}):",
            *indented([f"at_{row} = {value}" for row, value in enumerate(rows)], 4),
            *indented(
                [f"outputs[({row} * ticks + tick) * stride + first + lane] = {value}" for row, value in enumerate(_ROTATED)], 4
            ),
        ]
        return "\n".join(lines)

    def _passing(self) -> list[str]:
        """All teeth, at the tick and until the next one."""
        width = self.lanes
        now = [f"work[{row * width} + lane] += {name}_n_per_mm" for row, name in enumerate(("along", "across"))]
        parallel = [
            f"sine_tooth = work[{6 * width} + 2 * tooth]",
            f"cosine_tooth = work[{6 * width} + 2 * tooth + 1]",
            "sine_now = sine_lead * cosine_tooth + cosine_lead * sine_tooth",
            "cosine_now = cosine_lead * cosine_tooth - sine_lead * sine_tooth",
            "if begin_rad <= width_rad:",
            *indented([f"for lane in range({width}):", *indented([*self._forces("sine_now", "cosine_now"), *now], 1)], 1),
            *WINDOWS,
            *indented(self._nodes(("along", "across", "tangential"), "work[{row} + lane]", 3 * width), 3),
        ]
        lines = ["for tooth in range(teeth):", "    begin_rad = wrapped(lead_rad + tooth * pitch_rad)"]
        if not self.lagging:
            return [*lines, *indented(parallel, 1)]
        return [
            *lines,
            "    if lag_rad > 0.0:",
            *indented(STRETCHES, 2),
            *indented(PASSED, 3),
            *indented(self._nodes(("along", "across", "tangential"), "work[row + {row}]", 0, weighted=True), 6),
            "    else:",
            *indented(parallel, 2),
        ]

    def _nodes(self, names: tuple[str, ...], into: str, first: int, *, weighted: bool = False) -> list[str]:
        """One piece of the quadrature: four nodes for each lane, added up in rows from `first`."""
        order = ((1, "-", "+"), (2, "-", "+"), (2, "+", "-"), (1, "+", "-"))
        sines = ", ".join(f"sine_mid * c{k} {a} cosine_mid * s{k}" for k, a, _ in order)
        cosines = ", ".join(f"cosine_mid * c{k} {b} sine_mid * s{k}" for k, _, b in order)
        steps = (-NODES[0], -NODES[1], NODES[1], NODES[0])
        shares = (*WEIGHTS, *WEIGHTS[::-1])
        weights = [f"{g} * (weight + slope * (off_rad + half_rad * {x}))" for g, x in zip(shares, steps, strict=True)]
        return [
            f"sines = ({sines})",
            f"cosines = ({cosines})",
            f"shares = ({', '.join(weights if weighted else map(repr, shares))})",
            f"for lane in range({self.lanes}):",
            *indented([f"{name}_sum = 0.0" for name in names], 1),
            "    for node in range(4):",
            *indented(self._forces("sines[node]", "cosines[node]"), 2),
            *indented([f"{name}_sum += shares[node] * {name}_n_per_mm" for name in names], 2),
            *indented(
                [
                    f"{into.format(row=first + place * self.lanes, name=name)} += half_rad * {name}_sum"
                    for place, name in enumerate(names)
                ],
                1,
            ),
        ]

    def peak(self) -> str:
        """The greatest resultant over a tooth period (a turn, where teeth differ) of each cut, into `outputs`.

        Between the angles at which a tooth enters or leaves the force is smooth; the best of a few angles there is followed by
        parabolas. With a lag the force has no jumps, but kinks where the top of the edge enters or leaves.
        """
        assert self.lanes == 1 or not self.lagging
        lines = [
            KERNEL,
            "def resultant_at(turn_rad, standing, shift, lane, lag_rad, teeth, advance_mm, spindle_rpm, speed_mm_s,",
            "                 axial_depth_mm, entry_rad, width_rad, constants, radius_steps_mm):",
            *indented(["along = across = 0.0", *NOTHING_KEPT, *self._standing()], 1),
            "    return along * along + across * across",
            "",
            "",
            PEAK.format(
                kernel=KERNEL,
                at=AT,
                width=self.lanes,
                turns="teeth" if self.stepped else "1",
                lag="\n".join(indented(self._lag() or ["lag_rad = 0.0"], 3)),
                events="\n".join(indented(EVENTS if self.lagging else [], 5)),
            ),
        ]
        return "\n".join(lines)

    def _standing(self) -> list[str]:
        """All teeth at a turn of the tool; those before `standing` are in the cut, where an edge has no lag."""
        parallel = [
            "if tooth_in < standing:",
            *indented(self._forces("sin(entry_rad + place_rad)", "cos(entry_rad + place_rad)"), 1),
            *indented(["along += along_n_per_mm", "across += across_n_per_mm"], 1),
        ]
        lines = [
            "for tooth_in in range(teeth):",
            "    tooth = (tooth_in + shift) % teeth",
            "    place_rad = turn_rad + tooth_in * 6.283185307179586 / teeth",
        ]
        if not self.lagging:
            return [*lines, *indented(parallel, 1)]
        return [
            *lines,
            "    if lag_rad > 0.0:",
            "        start_rad, stop_rad, weight, slope = place_rad - lag_rad, place_rad, 1.0 / lag_rad, 0.0",
            *indented(PASSED, 2),
            *indented(self._nodes(("along", "across"), "{name}", 0, weighted=True), 5),
            "    else:",
            *indented(parallel, 2),
        ]


_TICK = [
    "spindle_rpm = spindle_rpm_in[tick]",
    "axial_depth_mm = axial_depth_mm_in[tick]",
    "x_mm_s = velocity_x_mm_s[tick]",
    "y_mm_s = velocity_y_mm_s[tick]",
    "speed_mm_s = sqrt(x_mm_s * x_mm_s + y_mm_s * y_mm_s)",
    "if spindle_rpm > 0.0 and axial_depth_mm > 0.0 and speed_mm_s > 0.0:",
    "    advance_mm = speed_mm_s * 60.0 / (teeth * spindle_rpm)",
    "    turn_rad = spindle_rpm * period_s * 0.10471975511965977",
    "    per_turn = 1.0 / turn_rad",
    "    heading_cosine = x_mm_s / speed_mm_s",
    "    heading_sine = y_mm_s / speed_mm_s",
    "    entry_rad = entry_angle_rad[tick]",
    "    width_rad = exit_angle_rad[tick] - entry_rad",
    "    width_rad = width_rad + 6.283185307179586 if width_rad < 0.0 else width_rad",
    "    lead_rad = spindle_angle_rad[tick] - atan2(y_mm_s, x_mm_s) - entry_rad",
    "    sine_tool = sin(spindle_angle_rad[tick])",
    "    cosine_tool = cos(spindle_angle_rad[tick])",
    "    sine_lead = sine_tool * heading_cosine - cosine_tool * heading_sine",
    "    cosine_lead = cosine_tool * heading_cosine + sine_tool * heading_sine",
]

_ROTATED = (
    "at_0 * heading_cosine - at_1 * heading_sine",
    "at_0 * heading_sine + at_1 * heading_cosine",
    "at_2 * heading_cosine - at_3 * heading_sine",
    "at_2 * heading_sine + at_3 * heading_cosine",
    "at_4",
)
