"""What machines of a made-up shop say at a moment: a pure function of time, so that history and the live stream agree."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from cnctwin.api.fleet import NO_GAP

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


class SignalValue(NamedTuple):
    """The value of a signal, with what its birth certificate states."""

    value: Value
    unit: str | None = None
    provenance: str = "measured"
    reason: str | None = None


def signals(number: int, at_s: float) -> dict[str, SignalValue]:
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
    values = {
        "exec_state": SignalValue("FEED_HOLD" if held else "ACTIVE"),
        "controller_mode": SignalValue("AUTOMATIC"),
        "program": SignalValue("BASE-PLATE.NC" if number % 3 else "HOUSING_2024-11_FIXTURE-B.NC"),
        "nc_block": SignalValue(block),
        "nc_line": SignalValue(40 + int(into_s * 3)),
        "tool_number": SignalValue(tool),
        "tool_change_active": SignalValue(changing),
        "spindle_rpm": SignalValue(rpm_now, "rev/min"),
        "spindle_rpm_cmd": SignalValue(0 if held else rpm, "rev/min"),
        "spindle_load_pct": SignalValue(load_now, "%"),
        "feed_mm_min": SignalValue(0 if held else feed, "mm/min"),
        "feed_override_pct": SignalValue(0 if held else 100, "%"),
        "axis_x_load_pct": SignalValue(round(12 + 3 * math.sin(at_s), 1), "%"),
        "axis_z_load_pct": SignalValue(round(28 + 2 * math.sin(at_s / 2), 1), "%"),
        "coolant_on": SignalValue(not changing),
        "alarm": SignalValue(""),
        "spindle_temp_c": SignalValue(round(22.0 + rise + off, 1), "°C"),
        "ambient_temp_c": SignalValue(22.0, "°C"),
        "vibration_rms_g": SignalValue(round(0.02 + load_now / 160.0, 3), "g"),
        "twin/spindle_temp_c": SignalValue(round(22.0 + rise, 2), "°C", MODELLED),
        "twin/spindle_temp_residual_k": SignalValue(round(off, 2), "K", MODELLED),
        "twin/gap_growing": SignalValue(number % 7 == 3, None, INFERRED),
        "twin/gap_spindle_temp_c": SignalValue(round(3.1 + 0.2 * number, 2), "floors", INFERRED),
        "twin/gap_spindle_load_pct": SignalValue(1.2, "floors", INFERRED),
        "twin/tool_change_gate": SignalValue(gate, None, INFERRED),
        "twin/alert_state": SignalValue("firing" if number % 9 == 5 else "none"),
    }
    if number % 4 == 3:
        why = "no model was given: [joint_anomaly] models names no folder"
        values |= {
            f"twin/{name}": SignalValue(None, None, INFERRED, why)
            for name in ("raw_score", "adjusted_score", "anomaly_threshold")
        }
    else:
        values["twin/raw_score"] = SignalValue(round(raw, 4), None, INFERRED)
        values["twin/adjusted_score"] = SignalValue(0.0 if gate else round(raw, 4), None, INFERRED)
        values["twin/anomaly_threshold"] = SignalValue(THRESHOLD, None, INFERRED)
    if rpm_now < 50:
        values["twin/cutting_force_n"] = SignalValue(
            None, "N", INFERRED, "spindle below 50 rev/min: power over speed means nothing"
        )
    else:
        force = 60000.0 * 0.85 * load_now / 100.0 * 7.5 / (math.pi * 12.0 * rpm_now) * 1000.0
        values["twin/cutting_force_n"] = SignalValue(round(force, 0), "N", INFERRED)
    return values


def _phase(into_s: float) -> tuple[float, tuple[float, int | None, int, float, int, str]]:
    for phase in PROGRAM:
        if into_s < phase[0]:
            return into_s, phase
        into_s -= phase[0]
    return 0.0, PROGRAM[0]


def value_object(signal: SignalValue, t_ms: int) -> dict[str, Any]:
    """As the interface gives it."""
    said: dict[str, Any] = {"value": signal.value, "t": t_ms, "unit": signal.unit, "quality": "bad" if signal.reason else "good"}
    return {**said, "provenance": signal.provenance, **({"reason": signal.reason} if signal.reason else {})}


def row(name: str, signal: SignalValue, t_ms: int) -> list[Any]:
    """As the stream gives it."""
    return [t_ms, name, signal.value, "bad" if signal.reason else "good", signal.reason]


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


def fleet_item(machine: str, values: Mapping[str, SignalValue], t_ms: int, *, online: bool) -> dict[str, Any]:
    """A machine in short."""
    item: dict[str, Any] = {key: values[name].value if name in values else None for key, name in FLEET.items()}
    gaps = [one.value for name, one in values.items() if name.startswith("twin/gap_") and isinstance(one.value, float)]
    told = {"gap": max(gaps, default=None), "gap_reason": None if gaps else NO_GAP}
    return {"machine": machine, "online": online, **item, **told, "last_t": t_ms}
