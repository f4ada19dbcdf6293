"""The milling force against closed forms, against its own definition, and against itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.errors import EffectError, TwinError
from twin.machine import Tool
from twin.process.milling import Milling, MillingForce, milling_force, tool_constants

PAPER = Tool(diameter_mm=6.0, teeth=2, tangential_coefficient_n_per_mm2=1230.0, radial_ratio=0.5)
MILL = Tool(diameter_mm=20.0, teeth=4, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)
FORCES = ("force_x_n", "force_y_n", "mean_force_x_n", "mean_force_y_n", "mean_tangential_n")
EFFECTS = {
    "cutting_coefficient": {"scale": 1.2},
    "edge_force": {"tangential_n_per_mm": 12.0, "radial_n_per_mm": 20.0},
    "size_effect": {"exponent": 0.25},
    "runout": {"eccentricity_mm": 0.01, "phase_rad": 0.7},
    "helix": {"angle_deg": 30.0},
}


def a_turn(
    ticks: int, *, rpm: float = 3600.0, feed_mm_min: float = 1440.0, depth_mm: float = 2.0, arc=(0.0, math.pi), heading=0.0
):
    """A motion at constant speed from the angle 0, 1 ms a tick."""
    angle = rpm / 60.0 * 2.0 * math.pi * 0.001 * np.arange(ticks)
    constant = [rpm, feed_mm_min / 60 * math.cos(heading), feed_mm_min / 60 * math.sin(heading), depth_mm, *arc]
    return Milling(angle, *[np.full(ticks, value) for value in constant])


def of(effects: dict[str, dict[str, float]]) -> dict[str, float]:
    return {f"{effect}__{name}": value for effect, values in effects.items() for name, value in values.items()}


def by_definition(motion: Milling, tool: Tool, tick: int, turned_rad: float = 0.0) -> tuple[float, float]:
    """Formats, section 4, word for word."""
    vx, vy, rpm = motion.velocity_x_mm_s[tick], motion.velocity_y_mm_s[tick], motion.spindle_rpm[tick]
    heading, advance = math.atan2(vy, vx), math.hypot(vx, vy) * 60.0 / (tool.teeth * rpm)
    along = across = 0.0
    entry, exit_ = motion.entry_angle_rad[tick], motion.exit_angle_rad[tick]
    for j in range(tool.teeth):
        phi = motion.spindle_angle_rad[tick] + turned_rad + 2 * math.pi * j / tool.teeth - heading
        if (phi - entry) % (2 * math.pi) <= (exit_ - entry) % (2 * math.pi):
            tangential = tool.tangential_coefficient_n_per_mm2 * motion.axial_depth_mm[tick] * advance * math.sin(phi)
            radial = tool.radial_ratio * tangential
            along += -tangential * math.cos(phi) - radial * math.sin(phi)
            across += tangential * math.sin(phi) - radial * math.cos(phi)
    return (
        along * math.cos(heading) - across * math.sin(heading),
        along * math.sin(heading) + across * math.cos(heading),
    )


def closed_mean(motion: Milling, tool: Tool, tick: int, period_s: float) -> tuple[float, float, float]:
    """Mean forces along and across a feed in +x, and tangential, from the integrals of sin cos, sin² and sin."""
    rpm, depth = motion.spindle_rpm[tick], motion.axial_depth_mm[tick]
    advance = motion.velocity_x_mm_s[tick] * 60.0 / (tool.teeth * rpm)
    turn = rpm / 60.0 * 2.0 * math.pi * period_s
    entry, exit_ = motion.entry_angle_rad[tick], motion.exit_angle_rad[tick]
    sin_cos = sin_sin = sin = 0.0
    for j in range(tool.teeth):
        begin = motion.spindle_angle_rad[tick] + 2 * math.pi * j / tool.teeth
        first = math.floor((begin - exit_) / (2 * math.pi))
        for k in range(first, first + int(turn / (2 * math.pi)) + 4):
            low, high = max(begin, entry + 2 * math.pi * k), min(begin + turn, exit_ + 2 * math.pi * k)
            if high > low:
                sin_cos += (math.sin(high) ** 2 - math.sin(low) ** 2) / 2
                sin_sin += (high - low) / 2 - (math.sin(2 * high) - math.sin(2 * low)) / 4
                sin += math.cos(low) - math.cos(high)
    factor = tool.tangential_coefficient_n_per_mm2 * depth * advance / turn
    ratio = tool.radial_ratio
    return factor * (-sin_cos - ratio * sin_sin), factor * (sin_sin - ratio * sin_cos), factor * sin


angles = st.floats(0.0, 2.0 * math.pi)


@given(angles, angles, st.floats(0.05, 6.0), angles, st.integers(1, 6), st.floats(500.0, 30000.0))
def test_the_force_at_a_tick_is_that_of_the_definition(spindle, heading, width, entry, teeth, rpm) -> None:
    tool = MILL.model_copy(update={"teeth": teeth})
    motion = Milling(
        *[np.array([v]) for v in (spindle, rpm, 20 * math.cos(heading), 20 * math.sin(heading), 2.0, entry, entry + width)]
    )
    pitch = 2 * math.pi / teeth
    off = [(spindle - heading - side) / pitch for side in (entry, entry + width)]
    if min(abs(x - round(x)) for x in off) > 1e-9:  # beside the jumps, where the last digit of an angle decides
        force = milling_force(tool_constants(tool), teeth, motion)
        assert (force.force_x_n[0, 0], force.force_y_n[0, 0]) == pytest.approx(by_definition(motion, tool, 0), abs=1e-8)


@given(
    angles, st.floats(0.05, 6.2), angles, st.integers(1, 6), st.floats(100.0, 60000.0), st.sampled_from([0.0005, 0.001, 0.004])
)
def test_the_mean_until_the_next_tick_is_the_integral_in_closed_form(spindle, width, entry, teeth, rpm, period_s) -> None:
    tool = MILL.model_copy(update={"teeth": teeth})
    motion = Milling(*[np.array([v]) for v in (spindle, rpm, 20.0, 0.0, 2.0, entry, entry + width)])
    force = milling_force(tool_constants(tool), teeth, motion, period_s=period_s)
    found = force.mean_force_x_n[0, 0], force.mean_force_y_n[0, 0], force.mean_tangential_n[0, 0]
    scale = 900.0 * 2.0 * 20.0 * 60.0 / (teeth * rpm)
    assert found == pytest.approx(closed_mean(motion, tool, 0, period_s), abs=1e-7 * scale)


def test_an_arc_through_two_pi_may_be_written_either_way() -> None:
    ends, goes_on = (a_turn(200, arc=(5.5, 1.0)), a_turn(200, arc=(5.5, 1.0 + 2 * math.pi)))
    one, other = (milling_force(tool_constants(MILL), 4, motion) for motion in (ends, goes_on))
    assert np.abs(one.force_x_n).max() > 1.0
    for name in FORCES:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-9)


def test_a_slot_takes_the_power_of_its_removal_rate() -> None:
    """A turn at 8,000 rev/min is 7.5 ms: ten of them are 75 ticks. K_t · a_p D v = 1230 · 0.8 · 6 mm · 400/60 mm/s = 39.36 W."""
    motion = a_turn(75, rpm=8000.0, feed_mm_min=400.0, depth_mm=0.8)
    force = milling_force(tool_constants(PAPER), 2, motion)
    assert force.cutting_power_w().mean() == pytest.approx(39.36, rel=1e-6)
    assert force.torque_nm().mean() * 8000.0 / 60.0 * 2.0 * math.pi == pytest.approx(39.36, rel=1e-6)


def test_a_slot_bears_against_the_feed_by_the_closed_form() -> None:
    """Mean along the feed −N K_e K_t a_p c / 4, across it N K_t a_p c / 4: 492/4 · 0.05 N with c = 0.025 mm and two teeth."""
    force = milling_force(tool_constants(PAPER), 2, a_turn(75, rpm=8000.0, feed_mm_min=400.0, depth_mm=0.8))
    assert force.mean_force_y_n.mean() == pytest.approx(2 * 1230.0 * 0.8 * 0.025 / 4, rel=1e-6)
    assert force.mean_force_x_n.mean() == pytest.approx(-0.5 * 2 * 1230.0 * 0.8 * 0.025 / 4, rel=1e-6)


@given(angles)
def test_a_turned_feed_turns_the_force(heading) -> None:
    straight = a_turn(40, arc=(0.4, 2.0))
    turned = a_turn(40, arc=(0.4, 2.0), heading=heading)
    turned = Milling(turned.spindle_angle_rad + heading, *[getattr(turned, name) for name in Milling.__slots__[1:]])
    one, other = (milling_force(tool_constants(MILL), 4, motion) for motion in (straight, turned))
    x = one.mean_force_x_n * math.cos(heading) - one.mean_force_y_n * math.sin(heading)
    np.testing.assert_allclose(other.mean_force_x_n, x, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "changed",
    [
        {"spindle_rpm": 0.0},
        {"spindle_rpm": -3600.0},
        {"axial_depth_mm": 0.0},
        {"axial_depth_mm": math.nan},
        {"entry_angle_rad": math.nan},
        {"exit_angle_rad": math.nan},
        {"velocity_x_mm_s": 0.0},
    ],
    ids=str,
)
def test_what_does_not_cut_bears_nothing(changed: dict[str, float]) -> None:
    motion = a_turn(20)
    arrays = {name: getattr(motion, name) for name in Milling.__slots__} | {k: np.full(20, v) for k, v in changed.items()}
    force = milling_force(tool_constants(MILL), 4, Milling(**arrays))
    assert all(not getattr(force, name).any() for name in FORCES)
    assert all(getattr(milling_force(tool_constants(MILL), 4, motion), name).any() for name in FORCES)


def same_bits(one: MillingForce, other: MillingForce, lane: int = 0) -> bool:
    return all(np.array_equal(getattr(one, name)[0], getattr(other, name)[lane]) for name in FORCES)


@pytest.mark.parametrize("effects", [(), tuple(EFFECTS)[:4], tuple(EFFECTS)], ids=len)
def test_plain_python_gives_the_same_bits(effects: tuple[str, ...]) -> None:
    constants = tool_constants(MILL) | of({name: EFFECTS[name] for name in effects})
    motion = a_turn(25, arc=(0.3, 2.2), heading=0.3)
    kernel = milling_force(constants, 4, motion, effects=effects)
    assert same_bits(kernel, milling_force(constants, 4, motion, effects=effects, reference_run=True))


@pytest.mark.parametrize("effects", [(), tuple(EFFECTS)[:4], tuple(EFFECTS)], ids=len)
def test_a_lane_gives_the_same_bits_alone_and_beside_others(effects: tuple[str, ...]) -> None:
    coefficients = np.linspace(500.0, 1500.0, 45)
    constants = tool_constants(MILL) | of({name: EFFECTS[name] for name in effects})
    motion = a_turn(25, arc=(0.3, 2.2), heading=0.3)
    batch = milling_force(constants | {"tangential_coefficient_n_per_mm2": coefficients}, 4, motion, effects=effects)
    for lane in (0, 31, 32, 44):
        alone = constants | {"tangential_coefficient_n_per_mm2": coefficients[lane]}
        assert same_bits(milling_force(alone, 4, motion, effects=effects), batch, lane)


def test_effects_at_their_null_values_change_no_bit() -> None:
    null = {"cutting_coefficient": {"scale": 1.0}, "edge_force": {"tangential_n_per_mm": 0.0, "radial_n_per_mm": 0.0}}
    null |= {"size_effect": {"exponent": 0.0}, "runout": {"eccentricity_mm": 0.0, "phase_rad": 0.7}, "helix": {"angle_deg": 0.0}}
    motion = a_turn(50, heading=1.0)
    bare = milling_force(tool_constants(MILL), 4, motion)
    assert same_bits(bare, milling_force(tool_constants(MILL) | of(null), 4, motion, effects=tuple(null)))


def test_each_lane_may_have_its_own_motion() -> None:
    motions = [a_turn(30, rpm=rpm, feed_mm_min=feed) for rpm, feed in ((3600.0, 1440.0), (8000.0, 400.0), (2400.0, 900.0))]
    together = Milling(*[np.stack([getattr(motion, name) for motion in motions]) for name in Milling.__slots__])
    force = milling_force(tool_constants(MILL), 4, together)
    for lane, motion in enumerate(motions):
        assert same_bits(milling_force(tool_constants(MILL), 4, motion), force, lane)
    assert force.cutting_speed_m_s[1, 0] == pytest.approx(math.pi * 0.020 * 8000.0 / 60.0)


@settings(max_examples=20)
@given(st.floats(0.1, 10.0))
def test_forces_are_proportional_to_the_coefficient(scale: float) -> None:
    motion = a_turn(20, arc=(0.3, 2.0))
    one = milling_force(tool_constants(MILL), 4, motion)
    other = milling_force(tool_constants(MILL) | {"tangential_coefficient_n_per_mm2": 900.0 * scale}, 4, motion)
    np.testing.assert_allclose(other.mean_force_x_n, one.mean_force_x_n * scale, rtol=1e-12, atol=1e-9)


def test_wrong_input_is_named() -> None:
    motion = a_turn(5)
    with pytest.raises(EffectError, match="radial_ratio of the cut is missing"):
        milling_force({"tool_diameter_mm": 6.0, "tangential_coefficient_n_per_mm2": 900.0}, 2, motion)
    with pytest.raises(EffectError, match="rated_power does not act on the cut"):
        milling_force(tool_constants(MILL), 4, motion, effects=["rated_power"])
    with pytest.raises(TwinError, match="radial_ratio has 2 values for 3 lanes"):
        three = {"radial_ratio": [0.4, 0.5], "tangential_coefficient_n_per_mm2": [1.0, 2.0, 3.0]}
        milling_force(tool_constants(MILL) | three, 4, motion)
    short = Milling(*[np.zeros(4 if name == "spindle_rpm" else 5) for name in Milling.__slots__])
    with pytest.raises(TwinError, match=r"spindle_rpm has the shape \(4,\)"):
        milling_force(tool_constants(MILL), 4, short)
