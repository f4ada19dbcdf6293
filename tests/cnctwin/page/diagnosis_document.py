"""A diagnosis.json as the page gets it."""

from typing import Any


def diagnosis() -> dict[str, Any]:
    """A small diagnosis.json: gravity on Z, found."""
    cell = {"effect_size": 57.0, "significance": 1e-12, "discovered": True}
    quiet = {"before": 0.00033, "after": 0.00033, "floor": 0.00042, "unit": "mm"}
    return {
        "verdict": "explained",
        "sentence": "Explained: the Z axis carries a constant load of 571 N that the twin does not know: gravity on Z.",
        "where": [
            {
                "signal": "z_torque_a",
                "regime": "constant speed -",
                "share": 0.46,
                "rms": 60.8,
                "sentence": "46 % of the gap in torque is in the Z torque at constant speed in −, 61 × the repeatability",
                **cell,
            },
            {
                "signal": "z_pos_mm",
                "regime": "rest",
                "share": 0.39,
                "rms": 14.1,
                "sentence": "39 % of the gap in position is in the Z position at standstill: mean 7.0 µm, 23 × the repeatability",
                **cell,
            },
            {
                "signal": "z_torque_a",
                "regime": "reversal",
                "share": 0.05,
                "rms": 4.4,
                "sentence": "5 % of the gap in torque is in the Z torque at reversals",
                **cell,
            },
        ],
        "where_after": [],
        "patterns": [],
        "causes": [
            {
                "effect": "gravity",
                "on": "z",
                "probability": 0.88,
                "closure": 0.99,
                "parameters": {"force_n": {"value": 571.3, "low": 556.4, "high": 586.1, "unit": "N"}},
                "indistinguishable_from": [{"effect": "sensor_bias", "on": "z_torque_a"}],
            }
        ],
        "gap": {
            "as_stated": 20.8,
            "before": 19.9,
            "after": 1.05,
            "floor": 1.0,
            "closure": 0.997,
            "closure_low": 0.991,
            "closure_high": 1.0,
            "by_signal": {
                "x_pos_mm": quiet,
                "z_pos_mm": {"before": 0.0079, "after": 0.00041, "floor": 0.00039, "unit": "mm"},
                "z_torque_a": {"before": 0.62, "after": 0.0122, "floor": 0.0119, "unit": "A"},
            },
        },
        "candidates": [],
        "not_observable": [
            {"effect": "runout", "why": "no force_x_n, force_y_n in any run"},
            {"effect": "coolant_cooling", "why": "no spindle_temp_c in any run that is fitted"},
        ],
        "not_identifiable": [],
        "next_experiment": {
            "why": "separates gravity on z from sensor_bias on z_torque_a: reversals of 2 to 100 µm",
            "program": "%\nN1 G21 G90\nN2 G4 P10000\nM30\n",
            "seconds": 38.0,
            "separation": 57.0,
        },
        "notes": [],
        "seconds": 21.0,
        "subsystems": [
            part("z mechanics", 57.2, 1.02, "explained", "gravity"),
            part("z controller", 0.6, 0.6, "healthy"),
        ],
        "constants": [{"name": "axes.y.mass_kg", "stated": 320.0, "found": 339.0, "deviations": 2.1, "closure": 0.4}],
        "learned": [
            {
                "site": "axis_force",
                "on": "x",
                "unit": "N",
                "depends_on": ["position"],
                "repeats": True,
                "closure": 0.81,
                "closure_low": 0.74,
                "closure_high": 0.86,
                "table": {"position_mm": [0.0, 2.5], "value": [1.2, 43.0], "low": [-0.5, 40.1], "high": [2.9, 45.9]},
                "looks_like": [{"effect": "direction_friction", "on": "x", "why_not": "it closes 31 %"}],
                "sentence": "a force on X of +43 N between 118 and 141 mm, in both directions",
            }
        ],
    }


def part(name: str, before: float, after: float, verdict: str, *causes: str) -> dict[str, Any]:
    """A subsystem of a diagnosis, compared in the Z torque."""
    shown = {"subsystem": name, "driven_by": [], "compared": "z_torque_a", "verdict": verdict, "causes": list(causes)}
    return shown | {"before": before, "after": after}
