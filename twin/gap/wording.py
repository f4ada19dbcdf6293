"""Signals, regimes and figures in the words of the shop floor, for sentences."""

import math

from twin.effects.catalogue import effect_named
from twin.runlog import AXIS_COLUMN

MINUS = "−"
COLUMN_WORDS = {"pos_mm": "position", "table_mm": "table position", "torque_a": "torque", "ref_mm": "reference"}
SIGNAL_WORDS = {
    "force_x_n": "the cutting force in X",
    "force_y_n": "the cutting force in Y",
    "spindle_load_pct": "the spindle load",
    "spindle_power_kw": "the spindle power",
    "spindle_temp_c": "the spindle temperature",
    "feed_mm_min": "the feed",
    "vibration_rms_g": "the vibration",
    "tool_change_s": "the tool change",
    "program_time_s": "the program time",
    "section_time_s": "the time of a section",
    "block_time_s": "the time of a block",
}
CONSTANT_WORDS = {
    "mass_kg": "mass",
    "inertia_kg_m2": "inertia",
    "torque_constant_nm_per_a": "torque constant",
    "force_per_command_n": "force per command",
    "torque_per_command_nm": "torque per command",
    "coulomb_n": "Coulomb friction",
    "coulomb_nm": "Coulomb friction",
    "static_n": "breakaway friction",
    "static_nm": "breakaway friction",
    "stribeck_velocity_mm_s": "Stribeck velocity",
    "stribeck_velocity_deg_s": "Stribeck velocity",
    "viscous_n_s_per_mm": "viscous friction",
    "viscous_nm_s_per_deg": "viscous friction",
    "tangential_coefficient_n_per_mm2": "cutting coefficient K_t",
    "radial_ratio": "ratio of radial to tangential force",
    "efficiency": "efficiency of the spindle drive",
    "idle_power_kw": "idle power of the spindle",
    "alpha_w_per_pct_rpm2": "heat by load of the spindle",
    "beta_w_per_rpm": "heat by speed of the spindle",
    "resistance_k_per_w": "thermal resistance",
    "capacity_j_per_k": "heat capacity",
}
REGIME_WORDS = {
    "rest": "at standstill",
    "reversal": "at reversals",
    "acceleration": "while it accelerates",
    "constant speed -": f"at constant speed in {MINUS}",
    "constant speed +": "at constant speed in +",
    "rapid": "at rapid",
    "tool change": "during tool changes",
    "cutting": "while cutting",
    "air": "in air",
    "dwell": "during dwells",
    "spindle ramp": "while the spindle changes speed",
    "warm-up": "while the spindle turns",
    "cool-down": "while the spindle stands",
    "run": "over the run",
}
GROUPS = {"pos_mm": "position", "table_mm": "position", "torque_a": "torque"}
SINGLE_GROUPS = {"force_x_n": "force", "force_y_n": "force", "spindle_load_pct": "load", "spindle_temp_c": "temperature"}


def signal_words(signal: str) -> str:
    """A signal in words.

    >>> signal_words("z_torque_a"), signal_words("spindle_temp_c")
    ('the Z torque', 'the spindle temperature')
    """
    match = AXIS_COLUMN.match(signal)
    return f"the {match[1].upper()} {COLUMN_WORDS[match[2]]}" if match else SIGNAL_WORDS.get(signal, signal)


def regime_words(regime: str) -> str:
    """A regime in words that go after those of a signal."""
    return REGIME_WORDS.get(regime, f"in {regime}")


def constant_words(path: str) -> str:
    """A constant of the machine, by its path in machine.toml, in words.

    >>> constant_words("axes.y.mass_kg"), constant_words("thermal.resistance_k_per_w")
    ('the mass of Y', 'the thermal resistance')
    """
    keys = path.split(".")
    words = CONSTANT_WORDS.get(keys[-1], f"{keys[-1].replace('_', ' ')} in [{'.'.join(keys[:-1])}]")
    of = {"axes": keys[1].upper(), "tools": f"tool {keys[1]}"}.get(keys[0], "") if len(keys) > 1 else ""
    return f"the {words}{f' of {of}' if of else ''}"


def group_of(signal: str) -> str:
    """Which signals share a gap: positions, torques, forces, load, temperature; any other is alone.

    >>> group_of("x_table_mm"), group_of("force_y_n"), group_of("vibration_rms_g")
    ('position', 'force', 'vibration_rms_g')
    """
    match = AXIS_COLUMN.match(signal)
    return GROUPS[match[2]] if match and match[2] in GROUPS else SINGLE_GROUPS.get(signal, signal)


def figure(value: float, unit: str) -> str:
    """A value with its unit to two or three digits; small lengths in µm.

    >>> figure(-0.6123, "A"), figure(0.00332, "mm"), figure(1234.5, "N")
    ('−0.61 A', '3.3 µm', '1230 N')
    """
    if unit == "mm" and abs(value) < 0.1:
        value, unit = 1000.0 * value, "µm"
    return f"{digits(value)} {unit}".strip()


def digits(value: float) -> str:
    """A number to two digits, three where it is 100 or more."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:.0f}"
    places = (3 if abs(value) >= 99.5 else 2) - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, places)
    return f"{rounded:.{max(places, 0)}f}".replace("-", MINUS)


def times_floor(size: float) -> str:
    """A size in floors.

    >>> times_floor(12.34), times_floor(1.26)
    ('12 × the repeatability', '1.3 × the repeatability')
    """
    return f"{digits(size)} × the repeatability"


def percent(part: float) -> str:
    """A part in whole percent, small ones as less than one.

    >>> percent(0.412), percent(0.001)
    ('41 %', 'less than 1 %')
    """
    return f"{100.0 * part:.0f} %" if part >= 0.01 else "less than 1 %"


def effect_words(effect: str, on: str = "") -> str:
    """An effect as a person on the shop floor would say it.

    >>> effect_words("coolant_cooling"), effect_words("gravity", "z"), effect_words("sensor_bias", "spindle_temp_c")
    ('coolant cools', 'a constant force pulls on Z', 'the spindle temperature is read with an offset')
    """
    return effect_named(effect).says.format(on=on.upper() if len(on) <= 2 else signal_words(on))
