"""Effects that no catalogue and no document names: the right answer to them is a term that is learned, without a name.

Each is a plain physical term, drawn and scaled as the named ones are. `described` says where it acts and on what it depends, in
the words of formats, section 6: more than once where two descriptions are equally right. A friction that depends on X is a force
that depends on X and the direction; what grows with the time since the start, or comes and goes, may be told by the time alone.
"""

from dataclasses import replace

from cnctwin.standins.reference_machine.effect import AXES, ActsAt, Chance, Effect, Parameters, between, described, none, sign
from cnctwin.standins.reference_machine.physics import Physics
from cnctwin.standins.reference_machine.program import deepest_mm

AIR = ("air",)
CUT = ("cut",)
WARM = ("warmup",)

_BY_SPEED = tuple(f"{site}: {words}" for site in ("friction", "axis_force") for words in ("velocity", "velocity direction"))
"""A friction of the speed, as one law or as one for each direction."""
_BY_POSITION = ("friction: position", "friction: position direction", "axis_force: position direction")
_BY_TIME = tuple(f"friction: {words}" for words in ("time_since_start", "time"))
_BY_TIME_AND_DIRECTION = tuple(f"axis_force: {words} direction" for words in ("time_since_start", "time"))
_BY_PLACE = tuple(f"cut_force: {words}{chip}" for words in ("position", "axis:x axis:y") for chip in ("", " chip"))
_FADING = tuple(f"{site}: {words}" for site in ("axis_force", "torque_reading") for words in ("load", "load time_since_start"))
_FORGETTING = tuple(f"controller: {words}" for words in ("load", "velocity", "direction", "velocity direction"))
_TIGHT = tuple(f"{site}: {words}" for site in ("heat_input", "heat_loss") for words in ("temperature", "temperature spindle_rpm"))


def _pump(physics: Physics, on: str, p: Parameters) -> Physics:
    return replace(physics, pump={**physics.pump, on: (p["force_n"], p["hertz"])})


def _other(on: str, p: Parameters) -> str:
    return "xyz"[("xyz".index(on) + int(p["from"])) % 3]


def _coupled(on: str, p: Parameters) -> tuple[ActsAt, ...]:
    return (ActsAt("axis_force", frozenset({f"axis:{_other(on, p)}"})),)


def _coupling(physics: Physics, on: str, p: Parameters) -> Physics:
    other = _other(on, p)
    return replace(physics, coupling={**physics.coupling, on: (other, p["mass_kg"])})


def _place(chance: Chance) -> Parameters:
    """A place off the axis' zero, and a width."""
    return {"at_mm": float(chance.choice([-1.0, 1.0]) * chance.uniform(4.0, 14.0)), "width_mm": float(chance.uniform(2.0, 6.0))}


def _hard_zone(chance: Chance) -> Parameters:
    start = float(chance.uniform(15.0, 50.0))
    return {**sign(chance), "from_mm": start, "to_mm": start + float(chance.uniform(25.0, 50.0))}


AXIS_EFFECTS = (
    Effect(
        "friction_spot", AXES, AIR, _place, lambda a, t: {"force_n": 60.0 * a, **t},
        lambda x, on, p: x.with_axis(on, spot_n=p["force_n"], spot_mm=p["at_mm"], spot_width_mm=p["width_mm"]),
        acts_at=described(*_BY_POSITION),
    ),
    Effect(
        "cable_chain", AXES, AIR, between(rest_mm=(-20.0, 20.0)), lambda a, t: {"n_per_mm": 1.5 * a, **t},
        lambda x, on, p: x.with_axis(on, cable_n_per_mm=p["n_per_mm"], cable_mm=p["rest_mm"]),
        acts_at=described("axis_force: position"),
    ),
    Effect(
        "quadratic_drag", AXES, AIR, none, lambda a, _: {"n_s2_per_mm2": 0.01 * a},
        lambda x, on, p: x.with_axis(on, drag_n_s2_per_mm2=p["n_s2_per_mm2"]),
        acts_at=described(*_BY_SPEED),
    ),
    Effect(
        "growing_breakaway", AXES, AIR, between(wait_s=(0.4, 2.5)), lambda a, t: {"force_n": 120.0 * a, **t},
        lambda x, on, p: x.with_axis(on, wait_n=p["force_n"], wait_s=p["wait_s"]), 6.0,
        acts_at=described(*_BY_SPEED, "friction: time", "axis_force: time"),
    ),
    Effect(
        "weakening_drive", AXES, AIR, between(fade_s=(3.0, 10.0)), lambda a, t: {"fade": 0.05 * a, **t},
        lambda x, on, p: x.with_axis(on, fade=p["fade"], fade_s=p["fade_s"], fade_a=1.0), 6.0,
        acts_at=described(*_FADING),
    ),
    Effect(
        "forgetful_integral", AXES, AIR, none, lambda a, _: {"leak_per_s": 2.0 * a},
        lambda x, on, p: x.with_axis(on, leak_per_s=p["leak_per_s"]),
        in_controller=True, acts_at=described(*_FORGETTING),
    ),
    Effect(
        "dragging_brake", AXES, AIR, between(until_s=(6.0, 16.0)), lambda a, t: {"force_n": 80.0 * a, **t},
        lambda x, on, p: x.with_axis(on, brake_n=p["force_n"], brake_until_s=p["until_s"]), 6.0,
        acts_at=described(*_BY_TIME, *_BY_TIME_AND_DIRECTION),
    ),
    Effect(
        "scale_graduation", AXES, AIR, between(pitch_mm=(0.6, 3.0)), lambda a, t: {"amplitude_mm": 0.002 * a, **t},
        lambda x, on, p: x.with_axis(on, scale_mm=p["amplitude_mm"], scale_pitch_mm=p["pitch_mm"]),
        acts_at=described("table_reading: position", "table_position: position"),
    ),
    Effect(
        "frame_coupling", AXES, AIR, between(**{"from": (1.0, 2.99)}), lambda a, t: {"mass_kg": 40.0 * a, **t}, _coupling,
        acts_at=_coupled,
    ),
    Effect(
        "hydraulic_pump", AXES, AIR, between(hertz=(0.7, 4.0)), lambda a, t: {"force_n": 20.0 * a, **t}, _pump,
        acts_at=described("axis_force: time"),
    ),
)  # fmt: skip

CUT_EFFECTS = (
    Effect(
        "chipped_tooth", ("",), CUT, none, lambda a, _: {"missing_mm": 0.01 * a},
        lambda x, _, p: x.with_part("cut", chipped_mm=p["missing_mm"]), 10.0,
        acts_at=described("cut_force: spindle_angle", "cut_force: spindle_angle chip"),
    ),
    Effect(
        "hard_zone", ("",), CUT, _hard_zone, lambda a, t: {"harder": 0.2 * a * t["sign"], **t},
        lambda x, _, p: x.with_part("cut", hard=p["harder"], hard_from_mm=p["from_mm"], hard_to_mm=p["to_mm"]), 4.0,
        acts_at=described(*_BY_PLACE),
    ),
    Effect(
        "depth_regime", ("",), CUT, none, lambda a, _: {"harder": 0.25 * a, "from_part": 0.68},
        lambda x, _, p: x.with_part("cut", deep=p["harder"], deep_mm=p["from_part"] * deepest_mm(x.cut.tangential)), 8.0,
        acts_at=described("cut_force: load", "cut_force: chip", "cut_force: load chip"),
    ),
    Effect(
        "chatter", ("",), CUT, between(hertz=(130.0, 460.0)), lambda a, t: {"n_per_mm": 8.0 * a, **t},
        lambda x, _, p: x.with_part("cut", chatter_n_per_mm=p["n_per_mm"], chatter_hz=p["hertz"]), 12.0,
        acts_at=described("cut_force: time", "cut_force: time load"),
    ),
    Effect(
        "bent_meter", ("",), CUT, sign, lambda a, t: {"bent": 0.15 * a * t["sign"]},
        lambda x, _, p: x.with_part("meter", bent=p["bent"]), 4.0,
        acts_at=described("spindle_power: load"),
    ),
    Effect(
        "meter_dead_band", ("",), CUT, none, lambda a, _: {"dead_pct": 1.5 * a},
        lambda x, _, p: x.with_part("meter", dead_pct=p["dead_pct"]), 2.0,
        acts_at=described("spindle_power: load", "spindle_power: time"),
    ),
    Effect(
        "mains_beat", ("",), CUT, between(hertz=(0.4, 3.1)), lambda a, t: {"beat_pct": 0.8 * a, **t},
        lambda x, _, p: x.with_part("meter", beat_pct=p["beat_pct"], beat_hz=p["hertz"]),
        acts_at=described("spindle_power: time"),
    ),
    Effect(
        "wearing_bearing", ("",), CUT, none, lambda a, _: {"kw_per_s": 0.02 * a},
        lambda x, _, p: x.with_part("meter", worn_kw_per_s=p["kw_per_s"]),
        acts_at=described("spindle_power: time_since_start", "spindle_power: time"),
    ),
)  # fmt: skip

HEAT_EFFECTS = (
    Effect(
        "cabinet_cycle", ("",), WARM, between(period_s=(900.0, 2400.0), part=(0.3, 0.6)), lambda a, t: {"heat_w": 20.0 * a, **t},
        lambda x, _, p: x.with_part("heat", cabinet_w=p["heat_w"], cabinet_period_s=p["period_s"], cabinet_part=p["part"]),
        acts_at=described("heat_input: time", "heat_loss: time"),
    ),
    Effect(
        "tight_bearing", ("",), WARM, between(from_k=(3.0, 8.0)), lambda a, t: {"more": 0.4 * a, **t},
        lambda x, _, p: x.with_part("heat", tight=p["more"], tight_k=p["from_k"]), 10.0,
        acts_at=described(*_TIGHT),
    ),
    Effect(
        "radiant_hall", ("",), WARM, sign, lambda a, t: {"w_per_s": 0.006 * a * t["sign"]},
        lambda x, _, p: x.with_part("heat", radiant_w_per_s=p["w_per_s"]),
        acts_at=described("heat_input: time_since_start", "heat_input: time"),
    ),
    Effect(
        "radiating_spindle", ("",), WARM, none, lambda a, _: {"power": 0.25 * a},
        lambda x, _, p: x.with_part("heat", radiating=p["power"]), 6.0,
        acts_at=described("heat_loss: temperature", "heat_input: temperature"),
    ),
)  # fmt: skip

UNNAMED = (*AXIS_EFFECTS, *CUT_EFFECTS, *HEAT_EFFECTS)
