"""The effects of the catalogue (formats, section 7), as this machine has them.

Names, places and parameters are the catalogue's. The forms are this machine's own where a real one would differ in a mild way:
viscosity follows a heat balance, ripples have a second harmonic, an edge takes a micrometre or two to bear fully, coolant comes
up within some seconds, a screw rings.
"""

from dataclasses import replace
from math import exp, pi

from cnctwin.standins.reference_machine.effect import AXES, Chance, Effect, Parameters, between, none, phase, sign
from cnctwin.standins.reference_machine.physics import Physics

MOTION = ("air", "cut")
SENSED_UNITS = {
    **{f"{a}_table_mm": 0.002 for a in AXES},
    **{f"{a}_torque_a": 0.03 for a in AXES},
    **{"force_x_n": 8.0, "force_y_n": 8.0, "spindle_load_pct": 1.0, "spindle_temp_c": 0.5},
}
"""A bias of each sensor that one would notice."""
LAGS_S = {
    **{f"{a}_table_mm": 0.001 for a in AXES},
    **{f"{a}_torque_a": 0.002 for a in AXES},
    **{"force_x_n": 0.002, "force_y_n": 0.002, "spindle_load_pct": 0.1, "spindle_temp_c": 20.0},
}


def _gain_traits(chance: Chance) -> Parameters:
    """Directions in which the three gains are off."""
    away = chance.uniform(0.4, 1.0, size=3) * chance.choice([-1.0, 1.0], size=3)
    return {"position": float(0.3 * away[0]), "velocity": float(away[1]), "integral": float(1.5 * away[2])}


def _ripple_traits(chance: Chance) -> Parameters:
    return {**phase(chance), "order": float(chance.choice([2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 24.0]))}


def _warmup(physics: Physics, on: str, p: Parameters) -> Physics:
    return physics.with_axis(on, warmup=p["decay"] / (1.0 - p["decay"]), warmup_s=p["time_constant_s"])


def _gains(physics: Physics, on: str, p: Parameters) -> Physics:
    axis = physics.axes[on]
    return physics.with_axis(
        on,
        position_gain=axis.position_gain * p["position_scale"],
        velocity_gain=axis.velocity_gain * p["velocity_scale"],
        integral_gain=axis.integral_gain * p["integral_scale"],
    )


def _limit(physics: Physics, on: str, p: Parameters) -> Physics:
    return physics.with_axis(on, limit_a=min(physics.axes[on].limit_a, p["limit_a"]))


def _mass(physics: Physics, on: str, p: Parameters) -> Physics:
    return physics.with_axis(on, mass_kg=physics.axes[on].mass_kg + p["mass_kg"])


def _edge(physics: Physics, _: str, p: Parameters) -> Physics:
    return physics.with_part("cut", edge_n_per_mm=p["tangential_n_per_mm"], edge_radial_n_per_mm=p["radial_n_per_mm"])


def _column(physics: Physics, _: str, p: Parameters) -> Physics:
    return physics.with_part("heat", column_w_per_k=p["conductance_w_per_k"], column_capacity=p["capacity_j_per_k"])


AXIS_EFFECTS = (
    Effect(
        "gravity", AXES, MOTION, sign, lambda a, t: {"force_n": 400.0 * a * t["sign"]},
        lambda x, on, p: x.with_axis(on, gravity_n=x.axes[on].gravity_n + p["force_n"]), 12.0, ("force_n",),
    ),
    Effect(
        "direction_friction", AXES, MOTION, sign, lambda a, t: {"asymmetry": 0.1 * a * t["sign"]},
        lambda x, on, p: x.with_axis(on, asymmetry=p["asymmetry"]), 5.0, (),
    ),
    Effect(
        "viscous_warmup", AXES, ("air",), between(tau=(6.0, 16.0)),
        lambda a, t: {"decay": 1.0 - exp(-0.35 * a), "time_constant_s": t["tau"]}, _warmup, 5.0, (),
    ),
    Effect(
        "presliding", AXES, MOTION, none, lambda a, _: {"stiffness_n_per_mm": 2e4 / a},
        lambda x, on, p: x.with_axis(on, bristle_n_per_mm=p["stiffness_n_per_mm"]), 20.0, ("stiffness_n_per_mm",), least=0.02,
    ),
    Effect(
        "backlash", AXES, MOTION, none, lambda a, _: {"play_mm": 0.01 * a},
        lambda x, on, p: x.with_axis(on, play_mm=p["play_mm"]), 20.0, ("play_mm",),
    ),
    Effect(
        "lead_error", AXES, MOTION, phase, lambda a, t: {"amplitude_mm": 0.005 * a, "phase_rad": t["phase_rad"]},
        lambda x, on, p: x.with_axis(on, wobble_mm=p["amplitude_mm"], wobble_rad=p["phase_rad"]), 15.0,
        ("amplitude_mm", "phase_rad"),
    ),
    Effect(
        "screw_compliance", AXES, MOTION, none, lambda a, _: {"stiffness_n_per_mm": 8e4 / a},
        lambda x, on, p: x.with_axis(on, screw_n_per_mm=p["stiffness_n_per_mm"]), 20.0, ("stiffness_n_per_mm",), least=0.01,
    ),
    Effect(
        "torque_ripple", AXES, MOTION, _ripple_traits, lambda a, t: {"amplitude_a": 0.05 * a, **t},
        lambda x, on, p: x.with_axis(on, ripple_a=p["amplitude_a"], ripple_order=p["order"], ripple_rad=p["phase_rad"]), 10.0,
        ("amplitude_a", "order", "phase_rad"),
    ),
    Effect("torque_limit", AXES, ("air",), none, lambda a, _: {"limit_a": 3.0 / a}, _limit, 6.0, ("limit_a",)),
    Effect("payload", AXES, MOTION, none, lambda a, _: {"mass_kg": 80.0 * a}, _mass, 12.0, ("mass_kg",)),
    Effect(
        "servo_gain", AXES, MOTION, _gain_traits,
        lambda a, t: {f"{name}_scale": exp(0.1 * a * t[name]) for name in ("position", "velocity", "integral")}, _gains, 6.0,
        ("position_scale", "velocity_scale", "integral_scale"), in_controller=True,
    ),
    Effect(
        "velocity_feedforward", AXES, MOTION, none, lambda a, _: {"gain": 0.3 * a},
        lambda x, on, p: x.with_axis(on, velocity_forward=p["gain"]), 3.0, ("gain",), in_controller=True,
    ),
    Effect(
        "acceleration_feedforward", AXES, MOTION, none, lambda a, _: {"gain": 0.3 * a},
        lambda x, on, p: x.with_axis(on, acceleration_forward=p["gain"]), 4.0, ("gain",), in_controller=True,
    ),
    Effect(
        "command_delay", AXES, MOTION, none, lambda a, _: {"delay_s": 0.002 * a},
        lambda x, on, p: x.with_axis(on, delay_s=p["delay_s"]), 10.0, ("delay_s",), in_controller=True,
    ),
    Effect(
        "thermal_growth", AXES, ("air",), sign, lambda a, t: {"um_per_k": 5.0 * a * t["sign"]},
        lambda x, on, p: x.with_axis(on, growth_mm_per_k=0.001 * p["um_per_k"]), 12.0, ("um_per_k",), warm=True,
    ),
)  # fmt: skip

CUT_EFFECTS = (
    Effect(
        "cutting_coefficient", ("",), ("cut",), sign, lambda a, t: {"scale": exp(0.2 * a * t["sign"])},
        lambda x, _, p: x.with_part("cut", tangential=x.cut.tangential * p["scale"]), 6.0, ("scale",),
    ),
    Effect(
        "edge_force", ("",), ("cut",), between(ratio=(0.5, 1.8)),
        lambda a, t: {"tangential_n_per_mm": 15.0 * a, "radial_n_per_mm": 15.0 * a * t["ratio"]},
        _edge, 10.0,
        ("tangential_n_per_mm", "radial_n_per_mm"),
    ),
    Effect(
        "size_effect", ("",), ("cut",), none, lambda a, _: {"exponent": 0.25 * a},
        lambda x, _, p: x.with_part("cut", thinning=p["exponent"]), 2.4, ("exponent",),
    ),
    Effect(
        "runout", ("",), ("cut",), phase, lambda a, t: {"eccentricity_mm": 0.01 * a, "phase_rad": t["phase_rad"]},
        lambda x, _, p: x.with_part("cut", runout_mm=p["eccentricity_mm"], runout_rad=p["phase_rad"]), 2.5, ("eccentricity_mm",),
    ),
    Effect(
        "helix", ("",), ("cut",), none, lambda a, _: {"angle_deg": 30.0 * a},
        lambda x, _, p: x.with_part("cut", helix_rad=p["angle_deg"] * pi / 180.0), 1.6, ("angle_deg",),
    ),
)  # fmt: skip

METER_EFFECTS = (
    Effect(
        "load_peak_hold", ("",), ("cut",), none, lambda a, _: {"hold_s": 0.5 * a},
        lambda x, _, p: x.with_part("meter", hold_s=p["hold_s"]), 8.0, ("hold_s",),
    ),
    Effect(
        "load_dependent_efficiency", ("",), ("cut",), between(knee_kw=(0.3, 1.2)),
        lambda a, t: {"drop": 1.0 - exp(-0.35 * a), "knee_kw": t["knee_kw"]},
        lambda x, _, p: x.with_part("meter", drop=p["drop"], knee_kw=p["knee_kw"]), 5.0, (),
    ),
    Effect(
        "rated_power", ("",), ("cut",), sign, lambda a, t: {"scale": exp(0.26 * a * t["sign"])},
        lambda x, _, p: x.with_part("meter", rated_kw=x.meter.rated_kw * p["scale"]), 4.0, ("scale",),
    ),
    Effect(
        "idle_speed_power", ("",), ("cut",), none, lambda a, _: {"power_kw": 0.3 * a},
        lambda x, _, p: x.with_part("meter", turning_kw=p["power_kw"]), 8.0, ("power_kw",),
    ),
)  # fmt: skip

HEAT_EFFECTS = (
    Effect(
        "second_thermal_mass", ("",), ("warmup",), between(capacity=(2e4, 8e4)),
        lambda a, t: {"conductance_w_per_k": 4.0 * a, "capacity_j_per_k": t["capacity"]},
        _column, 10.0, (),
    ),
    Effect(
        "speed_convection", ("",), ("warmup",), between(exponent=(0.5, 0.8)), lambda a, t: {"gain": 0.4 * a, **t},
        lambda x, _, p: x.with_part("heat", turning=p["gain"], turning_exponent=p["exponent"]), 12.0, ("gain",),
    ),
    Effect(
        "coolant_cooling", ("",), ("warmup",), none, lambda a, _: {"gain": 0.3 * a},
        lambda x, _, p: x.with_part("heat", coolant=p["gain"]), 20.0, ("gain",),
    ),
)  # fmt: skip

SENSOR_EFFECTS = tuple(
    effect
    for column, unit in SENSED_UNITS.items()
    for kinds in (("warmup",) if column == "spindle_temp_c" else ("cut",) if column[1] != "_" else MOTION,)
    for effect in (
        Effect(
            "sensor_bias", (column,), kinds, sign, lambda a, t, unit=unit: {"bias": unit * a * t["sign"]},  # type: ignore[misc]
            lambda x, on, p: x.with_sensor(on, bias=p["bias"]), 30.0, ("bias",),
        ),
        *(
            () if column.endswith("_table_mm") else (
                Effect(
                    "sensor_scale", (column,), kinds, sign, lambda a, t: {"scale": exp(0.05 * a * t["sign"])},
                    lambda x, on, p: x.with_sensor(on, scale=p["scale"]), 20.0, ("scale",),
                ),
            )
        ),
        Effect(
            "sensor_lag", (column,), kinds, none, lambda a, _, column=column: {"time_constant_s": LAGS_S[column] * a},  # type: ignore[misc]
            lambda x, on, p: x.with_sensor(on, lag_s=p["time_constant_s"]), 20.0, ("time_constant_s",),
        ),
    )
)  # fmt: skip

LATE_EFFECTS = tuple(
    Effect(
        "sensor_delay", (column,), ("warmup",) if column == "spindle_temp_c" else ("cut",) if column[1] != "_" else MOTION, none,
        lambda a, _, column=column: {"delay_s": LAGS_S.get(column, 0.001) * a},  # type: ignore[misc]
        lambda x, on, p: x.with_sensor(on, late_s=p["delay_s"]), 20.0, ("delay_s",),
    )
    for column in (*SENSED_UNITS, *(f"{a}_pos_mm" for a in AXES))
)  # fmt: skip
"""A position that is recorded late is in time for its loop."""


def _clock(physics: Physics, _: str, p: Parameters) -> Physics:
    return replace(physics, clock_ppm=p["ppm"], clock_offset_s=p["offset_s"])


CLOCK_EFFECTS = (
    Effect(
        "clock_drift", ("",), ("air",), between(sign=(-1.0, 1.0), offset=(-1.0, 1.0)),
        lambda a, t: {"ppm": 100.0 * a * (1.0 if t["sign"] > 0 else -1.0), "offset_s": 0.001 * a * t["offset"]}, _clock, 8.0,
        ("ppm", "offset_s"),
    ),
)  # fmt: skip

NAMED = (*AXIS_EFFECTS, *CUT_EFFECTS, *METER_EFFECTS, *HEAT_EFFECTS, *SENSOR_EFFECTS, *LATE_EFFECTS, *CLOCK_EFFECTS)
"""All of them; a sensor's once for each column that it can be on."""
