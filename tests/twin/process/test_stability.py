"""The stability lobes against their characteristic equation, closed forms and an integration of the vibration itself."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.twin.process.milling_vibration import Rotor, growth
from twin.errors import TwinError
from twin.machine import Mode
from twin.process.oriented import directional_matrix
from twin.process.stability import ChatterCut, depth_limit_mm, stable_speeds
from twin.process.tooth import tooth_force

SLOT = ChatterCut(4, 900.0, 0.4, 0.0, math.pi)
X = Mode(direction="x", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)
Y = Mode(direction="y", frequency_hz=610.0, damping_ratio=0.03, stiffness_n_per_mm=9000.0)

MODES = st.lists(
    st.builds(
        Mode,
        direction=st.sampled_from("xy"),
        frequency_hz=st.floats(200.0, 3000.0),
        damping_ratio=st.floats(0.01, 0.08),
        stiffness_n_per_mm=st.floats(2000.0, 50000.0),
    ),
    min_size=1,
    max_size=4,
)
CUTS = st.builds(
    ChatterCut,
    teeth=st.integers(1, 6),
    tangential_coefficient_n_per_mm2=st.floats(400.0, 3000.0),
    radial_ratio=st.floats(0.05, 0.9),
    entry_angle_rad=st.floats(0.0, 1.5),
    exit_angle_rad=st.floats(1.8, math.pi),
    heading_rad=st.floats(-math.pi, math.pi),
)
SPEEDS = st.floats(800.0, 30000.0)


def mean_of_teeth(cut: ChatterCut) -> NDArray[np.float64]:
    """A0 in the axes of the feed, summed up over the arc from the force of a tooth by chip."""
    matrix = np.zeros((2, 2))
    places, weights = np.polynomial.legendre.leggauss(30)
    width = cut.exit_angle_rad - cut.entry_angle_rad
    for phi, weight in zip(cut.entry_angle_rad + 0.5 * width * (places + 1.0), 0.5 * width * weights, strict=True):
        sine, cosine = math.sin(phi), math.cos(phi)
        force = tooth_force(1.0 / sine, sine, cosine, 0.0, cut.tangential_coefficient_n_per_mm2, cut.radial_ratio)
        matrix += weight * np.outer([force.along_n_per_mm, force.across_n_per_mm], [sine, cosine])
    return matrix * 2.0 / cut.tangential_coefficient_n_per_mm2 * cut.teeth / (2.0 * math.pi)


def unstable_roots(modes: Sequence[Mode], cut: ChatterCut, rpm: float, depth_mm: float) -> int:
    """Number of roots with a growing vibration of det(I − ½ b K_t (1 − e^(−sT)) A0 G(s)) = 0, by Nyquist's criterion.

    The determinant goes from 1 (s = 0) to 1 (s = i∞); each pair of roots in the right half is a turn clockwise around 0.
    """
    matrix = mean_of_teeth(cut)
    turn = np.array(
        [[math.cos(cut.heading_rad), -math.sin(cut.heading_rad)], [math.sin(cut.heading_rad), math.cos(cut.heading_rad)]]
    )
    period = 60.0 / (cut.teeth * rpm)
    factor = 0.5 * depth_mm * cut.tangential_coefficient_n_per_mm2
    natural = np.array([2 * math.pi * mode.frequency_hz for mode in modes])
    width = natural * np.array([mode.damping_ratio for mode in modes])
    softest = sum(w * w / mode.stiffness_n_per_mm for w, mode in zip(natural, modes, strict=True))
    top = 4 * natural.max() + math.sqrt(8.0 * factor * np.abs(matrix).sum() * softest)
    near = (natural[:, None] + width[:, None] * np.tan(np.linspace(-1.57, 1.57, 401))).ravel()
    omega = np.unique(np.concatenate([np.linspace(0.0, top, 2000 + int(4 * top * period)), near[(near > 0) & (near < top)]]))

    def determinant(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        response = np.zeros((2, len(omega)), dtype=complex)
        for mode in modes:
            r = omega / (2 * math.pi * mode.frequency_hz)
            response["xy".index(mode.direction)] += 1 / mode.stiffness_n_per_mm / (1 - r * r + 2j * mode.damping_ratio * r)
        seen = np.einsum("ji,jw,jk->wik", turn, response, turn)  # G in the axes of the feed: the other way round than the twin
        loop = factor * (1 - np.exp(-1j * omega * period))[:, None, None] * (matrix @ seen)
        values: NDArray[np.complex128] = (1 - loop[:, 0, 0]) * (1 - loop[:, 1, 1]) - loop[:, 0, 1] * loop[:, 1, 0]
        return values

    values = determinant(omega)
    for _ in range(20):  # until no step is long beside the distance from 0
        long = np.abs(np.diff(values)) > 0.3 * np.minimum(np.abs(values[1:]), np.abs(values[:-1]))
        if not long.any():
            break
        between = 0.5 * (omega[1:] + omega[:-1])[long]
        places = np.flatnonzero(long) + 1
        values, omega = np.insert(values, places, determinant(between)), np.insert(omega, places, between)
    return -2 * round(float(np.unwrap(np.angle(values))[-1]) / (2 * math.pi))


@given(CUTS)
def test_the_directional_matrix_is_the_mean_of_the_force_of_the_teeth(cut: ChatterCut) -> None:
    along = replace(cut, heading_rad=0.0)
    assert directional_matrix(along) == pytest.approx(mean_of_teeth(along), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(MODES, CUTS, SPEEDS)
def test_the_limit_divides_stable_from_unstable_within_half_a_percent(modes: list[Mode], cut: ChatterCut, rpm: float) -> None:
    limit = float(depth_limit_mm(modes, cut, rpm)[0])
    assume(limit < 1e3)
    assert unstable_roots(modes, cut, rpm, 0.995 * limit) == 0
    assert unstable_roots(modes, cut, rpm, 1.005 * limit) > 0


@pytest.mark.parametrize("heading", [0.0, 0.4, math.pi / 2, 2.0])
def test_one_mode_is_nowhere_worse_than_its_closed_form(heading: float) -> None:
    """−Re G is at most 1 / (4 ζ (1 + ζ) k), at √(1 + 2ζ) ω_n: b = 4 ζ (1 + ζ) k / (K_t |a|); in a slot |a| = N K_e / 2."""
    slot = replace(SLOT, heading_rad=heading)
    least = 4 * 0.02 * 1.02 * 8000.0 / (900.0 * 4 * 0.4 / 2)
    speeds = np.linspace(1000.0, 9000.0, 2000)
    limits = depth_limit_mm([X], slot, speeds)
    assert limits.min() == pytest.approx(least, rel=2e-4)
    assert limits.min() > least * (1 - 2e-4)
    # at the worst frequency, G = (−2ζ − 2iζ√(1 + 2ζ)) / (k·8ζ²(1 + ζ)), and a tooth period is ε + 2πk of its waves
    omega = math.sqrt(1.04) * 2 * math.pi * 500.0
    phase = math.pi + 2 * math.atan2(math.sqrt(1.04), 1.0)
    worst = [60.0 * omega / (4 * (phase + 2 * math.pi * k)) for k in range(6)]
    assert depth_limit_mm([X], slot, worst) == pytest.approx(np.full(6, least), rel=2e-4)


def test_equal_modes_in_a_slot_have_the_limit_of_a_complex_coefficient() -> None:
    """A0 = ½ N (−K_e ± i) on G: Re λ = ½ N (K_e (−Re G) − Im G); its largest over frequency, by a fine search."""
    modes = [X, Mode(direction="y", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)]
    r = np.linspace(0.9, 1.1, 400_001)
    response = 1 / (8000.0 * (1 - r * r + 0.04j * r))
    least = 1 / (900.0 * 2 * (-0.4 * response.real - response.imag).max())
    assert depth_limit_mm(modes, SLOT, np.linspace(1000.0, 8000.0, 3000)).min() == pytest.approx(least, rel=2e-4)


SIMULATED = [  # cut, part of the limit that has to decay, part that has to grow
    (SLOT, 0.95, 1.05),  # two of four teeth always cut, a quarter turn apart: A is the same at all times, zero order exact
    (replace(SLOT, teeth=3), 0.85, 1.15),
    (replace(SLOT, teeth=2), 0.7, 1.4),
    (replace(SLOT, entry_angle_rad=math.pi / 3), 0.7, 1.4),
    (replace(SLOT, exit_angle_rad=2.0), 0.7, 1.4),
]


def test_below_the_limit_the_vibration_itself_decays_and_above_it_grows() -> None:
    rotors = []
    for cut, inside, outside in SIMULATED:
        angles = (cut.entry_angle_rad, cut.exit_angle_rad)
        for tooth_hz in (193.0, 273.0, 347.0, 433.0, 513.0, 653.0):
            rpm = 60.0 * tooth_hz / cut.teeth
            limit = float(depth_limit_mm([X, Y], cut, rpm)[0])
            rotors += [Rotor(cut.teeth, 900.0, 0.4, *angles, rpm, part * limit) for part in (inside, outside)]
    grown = growth((8000.0, 9000.0), (500.0, 610.0), (0.02, 0.03), rotors).reshape(len(SIMULATED), 6, 2)
    assert (grown[:, :, 0] < 0.95).all(), grown[:, :, 0]
    assert (grown[:, :, 1] > 1.05).all(), grown[:, :, 1]


@settings(max_examples=30)
@given(MODES, CUTS, SPEEDS, st.floats(0.1, 10.0))
def test_stiffer_modes_and_softer_material_raise_the_limit_in_proportion(
    modes: list[Mode], cut: ChatterCut, rpm: float, factor: float
) -> None:
    limit = depth_limit_mm(modes, cut, rpm)
    stiffer = [m.model_copy(update={"stiffness_n_per_mm": factor * m.stiffness_n_per_mm}) for m in modes]
    harder = replace(cut, tangential_coefficient_n_per_mm2=factor * cut.tangential_coefficient_n_per_mm2)
    assert depth_limit_mm(stiffer, cut, rpm) == pytest.approx(factor * limit, rel=1e-6)
    assert depth_limit_mm(modes, harder, rpm) == pytest.approx(limit / factor, rel=1e-6)


@settings(max_examples=30)
@given(MODES, CUTS, SPEEDS)
def test_machine_and_heading_turned_together_by_a_right_angle_change_nothing(
    modes: list[Mode], cut: ChatterCut, rpm: float
) -> None:
    turned = [m.model_copy(update={"direction": "y" if m.direction == "x" else "x"}) for m in modes]
    quarter = replace(cut, heading_rad=cut.heading_rad + math.pi / 2)
    assert depth_limit_mm(turned, quarter, rpm) == pytest.approx(depth_limit_mm(modes, cut, rpm), rel=1e-6)
    back = replace(cut, heading_rad=cut.heading_rad + math.pi)
    assert depth_limit_mm(modes, back, rpm) == pytest.approx(depth_limit_mm(modes, cut, rpm), rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(MODES, CUTS, st.floats(0.5, 20.0))
def test_stable_speeds_are_those_whose_limit_is_above_the_depth(modes: list[Mode], cut: ChatterCut, part: float) -> None:
    low, high = 1500.0, 25000.0
    speeds = np.linspace(low, high, 3001)
    limits = depth_limit_mm(modes, cut, speeds)
    depth = part * float(limits.min())
    found = stable_speeds(modes, cut, depth, low, high)
    inside = np.zeros(len(speeds), dtype=bool)
    for begin, end in found:
        assert low <= begin < end <= high
        inside |= (speeds >= begin) & (speeds <= end)
    clear = np.abs(limits / depth - 1.0) > 0.01
    assert (inside == (limits >= depth))[clear].all()


@settings(max_examples=20, deadline=None)
@given(MODES, CUTS, st.floats(1.2, 5.0))
def test_an_end_of_the_stable_speeds_is_where_a_vibration_begins_to_grow(modes: list[Mode], cut: ChatterCut, part: float) -> None:
    low, high = 3000.0, 15000.0
    depth = part * float(depth_limit_mm(modes, cut, np.linspace(low, high, 1000)).min())
    for begin, end in stable_speeds(modes, cut, depth, low, high)[-2:]:
        if end - begin < 0.2:
            continue
        assert unstable_roots(modes, cut, begin + 0.1, depth) == 0
        assert unstable_roots(modes, cut, end - 0.1, depth) == 0
        for beyond in [rpm for rpm, last in ((begin - 0.1, low), (end + 0.1, high)) if abs(rpm - last) > 0.2]:
            limit = float(depth_limit_mm(modes, cut, beyond)[0])  # far below the depth where a lobe turns back
            assert limit < 1.0001 * depth
            assert unstable_roots(modes, cut, beyond, 1.005 * limit) > 0


def test_where_nothing_is_cut_or_nothing_gives_way_there_is_no_limit() -> None:
    air = replace(SLOT, exit_angle_rad=0.0)
    for modes, cut in (([], SLOT), ([X, Y], air)):
        assert np.isinf(depth_limit_mm(modes, cut, [3000.0, 8000.0])).all()
        assert stable_speeds(modes, cut, 50.0, 1000.0, 8000.0) == ((1000.0, 8000.0),)
    assert stable_speeds([X, Y], SLOT, 0.0, 1000.0, 8000.0) == ((1000.0, 8000.0),)
    assert stable_speeds([X, Y], SLOT, 50.0, 1000.0, 8000.0) == ()
    assert depth_limit_mm([X], SLOT, []).shape == (0,)


@pytest.mark.parametrize("rpm", [2000.0, 3500.0, 6500.0, 9000.0])
def test_a_range_of_one_speed_is_stable_or_not(rpm: float) -> None:
    limit = float(depth_limit_mm([X, Y], SLOT, rpm)[0])
    assert stable_speeds([X, Y], SLOT, 0.99 * limit, rpm, rpm) == ((rpm, rpm),)
    assert stable_speeds([X, Y], SLOT, 1.01 * limit, rpm, rpm) == ()


def test_an_arc_through_the_back_is_one_arc() -> None:
    over = ChatterCut(2, 900.0, 0.4, 5.5, 1.0)
    assert directional_matrix(over) == pytest.approx(directional_matrix(replace(over, exit_angle_rad=1.0 + 2 * math.pi)))


def test_speeds_that_are_none_are_refused_by_name() -> None:
    with pytest.raises(TwinError, match=r"spindle_rpm has 0\.0"):
        depth_limit_mm([X], SLOT, [3000.0, 0.0])
    with pytest.raises(TwinError, match=r"from 0\.0 to 8000\.0"):
        stable_speeds([X], SLOT, 1.0, 0.0, 8000.0)
