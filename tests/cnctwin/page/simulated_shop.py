"""What machines of a made-up shop say at a moment: a pure function of time, so that history and the live stream agree."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

Value = float | int | str | bool | None
PROGRAM = (  # seconds, tool, what it does: rpm, load, feed, block
    (9.0, 1, 6000, 31.0, 1800, "G1 X86.2 F1800"),
    (6.0, None, 0, 0.0, 0, "M6 T2"),
    (14.0, 2, 7500, 24.0, 1500, "G1 X-12.5 Y40. F1500"),
    (6.0, None, 0, 0.0, 0, "M6 T5"),
    (22.0, 5, 4200, 46.0, 900, "G2 X30.61 Y12.4 I-8. J0."),
    (3.0, 5, 800, 4.0, 15000, "G0 Z120."),
)
CYCLE_S = sum(phase[0] for phase in PROGRAM)
THRESHOLD = 0.12
MODELLED, INFERRED = "modelled", "inferred"


class Told(NamedTuple):
    """A value with what a birth certificate says of it."""

    value: Value
    unit: str | None = None
    provenance: str = "measured"
    reason: str | None = None


def signals(number: int, at_s: float) -> dict[str, Told]:
    """All signals of machine `number`; the third of each four holds its feed, the fourth has no score."""
    _, into_s = divmod(at_s + 17.0 * number, CYCLE_S)
    held = number % 4 == 2
    if held:
        into_s = 20.0
    phase_s, (_, tool, rpm, load, feed, block) = _phase(into_s)
    changing = tool is None
    ripple = 0.0 if rpm == 0 or held else 2.4 * math.sin(7.1 * at_s + number) + 1.1 * math.sin(23.0 * at_s)
    rpm_now = 0 if held else round(rpm * min(1.0, phase_s / 0.8) + (9 * math.sin(at_s * 3.3) if rpm else 0))
    load_now = round(max(0.0, (load + ripple) * (1.0 + 0.03 * math.sin(number)) * (0.06 if held else 1.0)), 1)
    warm = 1.0 - math.exp(-(at_s % 5400.0) / 1500.0)
    rise = 17.0 * warm + 0.35 * math.sin(2 * math.pi * at_s / CYCLE_S)
    off = 0.9 + 0.4 * math.sin(at_s / 240.0)
    raw = (
        -0.05
        + 0.03 * math.sin(at_s * 1.7)
        + 0.16 * math.exp(-((((at_s % 180.0) - 90.0) / 5.0) ** 2))
        + (0.22 if changing else 0.0)
    )
    gate = not held and (changing or 9.0 < into_s < 23.0)
    told = {
        "exec_state": Told("FEED_HOLD" if held else "ACTIVE"),
        "controller_mode": Told("AUTOMATIC"),
        "program": Told("BASE-PLATE.NC" if number % 3 else "HOUSING_2024-11_FIXTURE-B.NC"),
        "nc_block": Told(block),
        "nc_line": Told(40 + int(into_s * 3)),
        "tool_number": Told(tool),
        "tool_change_active": Told(changing),
        "spindle_rpm": Told(rpm_now, "rev/min"),
        "spindle_rpm_cmd": Told(0 if held else rpm, "rev/min"),
        "spindle_load_pct": Told(load_now, "%"),
        "feed_mm_min": Told(0 if held else feed, "mm/min"),
        "feed_override_pct": Told(0 if held else 100, "%"),
        "axis_x_load_pct": Told(round(12 + 3 * math.sin(at_s), 1), "%"),
        "axis_z_load_pct": Told(round(28 + 2 * math.sin(at_s / 2), 1), "%"),
        "coolant_on": Told(not changing),
        "alarm": Told(""),
        "spindle_temp_c": Told(round(22.0 + rise + off, 1), "°C"),
        "ambient_temp_c": Told(22.0, "°C"),
        "vibration_rms_g": Told(round(0.02 + load_now / 160.0, 3), "g"),
        "twin/spindle_temp_c": Told(round(22.0 + rise, 2), "°C", MODELLED),
        "twin/spindle_temp_residual_k": Told(round(off, 2), "K", MODELLED),
        "twin/gap_growing": Told(number % 7 == 3, None, INFERRED),
        "twin/gap_spindle_temp_c": Told(round(3.1 + 0.2 * number, 2), "floors", INFERRED),
        "twin/gap_spindle_load_pct": Told(1.2, "floors", INFERRED),
        "twin/tool_change_gate": Told(gate, None, INFERRED),
        "twin/alert_state": Told("firing" if number % 9 == 5 else "none"),
    }
    if number % 4 == 3:
        why = "no model was given: [joint_anomaly] models names no folder"
        told |= {f"twin/{name}": Told(None, None, INFERRED, why) for name in ("raw_score", "adjusted_score", "anomaly_threshold")}
    else:
        told["twin/raw_score"] = Told(round(raw, 4), None, INFERRED)
        told["twin/adjusted_score"] = Told(0.0 if gate else round(raw, 4), None, INFERRED)
        told["twin/anomaly_threshold"] = Told(THRESHOLD, None, INFERRED)
    if rpm_now < 50:
        told["twin/cutting_force_n"] = Told(None, "N", INFERRED, "spindle below 50 rev/min: power over speed means nothing")
    else:
        force = 60000.0 * 0.85 * load_now / 100.0 * 7.5 / (math.pi * 12.0 * rpm_now) * 1000.0
        told["twin/cutting_force_n"] = Told(round(force, 0), "N", INFERRED)
    return told


def _phase(into_s: float) -> tuple[float, tuple[float, int | None, int, float, int, str]]:
    for phase in PROGRAM:
        if into_s < phase[0]:
            return into_s, phase
        into_s -= phase[0]
    return 0.0, PROGRAM[0]


def value_object(told: Told, t_ms: int) -> dict[str, Any]:
    """As the interface gives it."""
    said: dict[str, Any] = {"value": told.value, "t": t_ms, "unit": told.unit, "quality": "bad" if told.reason else "good"}
    return {**said, "provenance": told.provenance, **({"reason": told.reason} if told.reason else {})}


def row(name: str, told: Told, t_ms: int) -> list[Any]:
    """As the stream gives it."""
    return [t_ms, name, told.value, "bad" if told.reason else "good", told.reason]


FLEET = {
    "exec_state": "exec_state",
    "program": "program",
    "tool_number": "tool_number",
    "alarm": "alarm",
    "spindle_load_pct": "spindle_load_pct",
    "spindle_rpm": "spindle_rpm",
    "alert_state": "twin/alert_state",
    "score": "twin/adjusted_score",
    "threshold": "twin/anomaly_threshold",
    "gated": "twin/tool_change_gate",
    "growing": "twin/gap_growing",
}


def fleet_item(machine: str, told: Mapping[str, Told], t_ms: int, *, online: bool) -> dict[str, Any]:
    """A machine in short."""
    item: dict[str, Any] = {key: told[name].value if name in told else None for key, name in FLEET.items()}
    gaps = [one.value for name, one in told.items() if name.startswith("twin/gap_") and isinstance(one.value, float)]
    return {"machine": machine, "online": online, **item, "gap": max(gaps, default=None), "last_t": t_ms}
