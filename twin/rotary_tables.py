"""Rotary axes in the tables of a machine file: in degrees and N m there, as a point that moves 1 mm a degree inside.

Axes, their uncertainty, the noise of their sensors, effects and learned terms on them; `twin.rotary` has the names and units.
"""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from twin.errors import MachineError
from twin.learned.sites import UNITS
from twin.learned.words import OF_AXIS
from twin.rotary import (
    PER_NM,
    Letters,
    inside_column,
    inside_name,
    inside_path,
    outside_name,
    outside_names,
    outside_path,
    outside_unit,
    scale_of,
)

Tables = dict[str, Any]
DIGITS = 12
"""Digits with which a figure is written, so that a file that was read is written as it was."""
TURNING = tuple(outside_name(column)[0] for column in OF_AXIS)
DISTURBANCE, TURNING_DISTURBANCE = "disturbance_force_n", "disturbance_torque_nm"
FIGURES = ("value", "low", "high")


def tables_inside(tables: Mapping[str, Any], *, scaled: bool = True) -> Tables:
    """Return the tables of a machine file with its rotary axes as they are inside.

    scaled: figures become those of the units inside; without it a fault can be told in the figures of the file

    Raises MachineError where an axis has keys of both kinds.
    """
    found = dict(tables)
    axes, noise = found.get("axes"), found.get("noise")
    if isinstance(noise, dict) and TURNING_DISTURBANCE in noise:
        force = _times(noise[TURNING_DISTURBANCE], PER_NM if scaled else 1.0)
        found["noise"] = {key: value for key, value in noise.items() if key != TURNING_DISTURBANCE} | {DISTURBANCE: force}
    if not isinstance(axes, dict):
        return found
    letters = {a: _scale(axis) for a, axis in axes.items() if isinstance(axis, dict) and _is_rotary(a, axis)}
    if not letters:
        return found
    if isinstance(noise, dict) and TURNING_DISTURBANCE in noise:
        found["noise"][DISTURBANCE] = _times(found["noise"][DISTURBANCE], max(letters.values()))
    found["axes"] = {
        a: _renamed(axis, inside_name, letters[a], scaled=scaled) | {"scale": letters[a]} if a in letters else axis
        for a, axis in axes.items()
    }
    if isinstance(found.get("uncertainty"), dict):
        found["uncertainty"] = {inside_path(path, letters): value for path, value in found["uncertainty"].items()}
    machine = found.get("machine")
    if isinstance(machine, dict) and isinstance(machine.get("assumed"), list):
        found["machine"] = machine | {"assumed": [inside_path(str(path), letters) for path in machine["assumed"]]}
    if isinstance(found.get("assumed"), dict):
        found["assumed"] = {
            inside_path(path, letters): _range_times(one, _factor(path, letters) if scaled else 1.0)
            for path, one in found["assumed"].items()
        }
    if isinstance(found.get("effects"), list):
        found["effects"] = [_effect_inside(e, letters) if isinstance(e, dict) else e for e in found["effects"]]
    return found


def tables_outside(tables: Mapping[str, Any], letters: Letters) -> Tables:
    """Return the tables of a machine, as they are inside, as its file has them."""
    found = dict(tables)
    found["axes"] = {
        a: _renamed(axis, outside_name, letters[a], outwards=True) if a in letters else axis for a, axis in tables["axes"].items()
    }
    noise = dict(tables.get("noise", {}))
    if DISTURBANCE in noise and letters.keys() == tables["axes"].keys() and len(set(letters.values())) == 1:
        noise[TURNING_DISTURBANCE] = _over(noise.pop(DISTURBANCE), PER_NM * max(letters.values()))  # one for all axes
    found["noise"] = noise
    found["uncertainty"] = {outside_path(path, letters): value for path, value in tables.get("uncertainty", {}).items()}
    named_only = tables["machine"].get("assumed", [])
    found["machine"] = tables["machine"] | {"assumed": [outside_path(path, letters) for path in named_only]}
    found["assumed"] = {
        (named := outside_path(path, letters)): _range_times(one, 1.0 / _factor(named, letters))
        for path, one in tables.get("assumed", {}).items()
    }
    found["effects"] = [_effect_outside(effect, letters) for effect in tables.get("effects", [])]
    return found


def term_outside(table: Mapping[str, Any], on: str, unit: str, letters: Letters) -> Tables:
    """Return the table of a learned term on an axis, a signal or nothing, as it is inside, as a file has it.

    >>> term_outside({"position_mm": [0.0, 9.0], "value": [0.0, 2.0 * PER_NM]}, "b", "N", {"b": 1.0})
    {'position_deg': [0.0, 9.0], 'value': [0.0, 2.0]}
    """
    factor = outside_unit(unit, scale_on(on, letters))[1] if is_on(on, letters) else 1.0
    return {
        _argument(column, on, letters, OF_AXIS, outside_name): _over(values, factor) if column in FIGURES else values
        for column, values in table.items()
    }


def is_on(on: str, letters: Collection[str]) -> bool:
    """Return True where this is one of the axes, or a signal of one.

    >>> is_on("b", {"b"}), is_on("b_pos_mm", {"b"}), is_on("", {"b"})
    (True, True, False)
    """
    return on.partition("_")[0] in letters


def scale_on(on: str, letters: Letters) -> float:
    """Return the scale of the axis that this is, or is a signal of; 1 where it is another one."""
    return letters.get(on.partition("_")[0], 1.0)


def _factor(path: str, letters: Letters) -> float:
    """Return how many units inside one unit of the figure at a path of the file is."""
    parts = path.split(".")
    return inside_name(parts[-1], letters[parts[1]])[1] if len(parts) > 2 and parts[0] == "axes" and parts[1] in letters else 1.0


def _range_times(entry: Any, factor: float) -> Any:
    """An entry of [assumed] with its range in other units; it may have anything in it."""
    if factor == 1.0 or not isinstance(entry, Mapping) or not isinstance(entry.get("range"), list | tuple):
        return entry
    return {
        **entry,
        "range": [float(f"{one * factor:.{DIGITS}g}") if isinstance(one, float | int) else one for one in entry["range"]],
    }


def _scale(axis: Mapping[str, Any]) -> float:
    """The scale of an axis as its file has it, which may have anything in it."""
    friction = axis.get("friction")
    coulomb = friction.get("coulomb_nm") if isinstance(friction, dict) else None
    coulomb = coulomb[0] if isinstance(coulomb, list) and coulomb else coulomb
    inertia = axis.get("inertia_kg_m2")
    known = [float(v) if isinstance(v, int | float) and v > 0.0 else 0.0 for v in (coulomb, inertia)]
    return scale_of(*known)


def _is_rotary(letter: str, axis: Mapping[str, Any]) -> bool:
    friction = axis.get("friction")
    keys = [*axis, *(friction if isinstance(friction, dict) else ())]
    rotary = [key for key in keys if inside_name(key)[0] != key]
    linear = [key for key in keys if outside_name(key)[0] != key or key == "torque_constant_nm_per_a"]
    if "scale" in axis:
        raise MachineError(f"axes.{letter}.scale is not known; docs/reference/machine.md lists what is")
    if rotary and linear:
        raise MachineError(f"axes.{letter} has {rotary[0]} of a rotary axis and {linear[0]} of a linear one; state one kind")
    return bool(rotary)


def _renamed(
    table: Mapping[str, Any],
    name_of: Callable[[str, float], tuple[str, float]],
    scale: float,
    *,
    scaled: bool = True,
    outwards: bool = False,
) -> Tables:
    """A table, and the tables in it, under other names and in other units."""
    found: Tables = {}
    for key, value in table.items():
        name, factor = name_of(key, scale)
        if isinstance(value, dict):
            found[name] = _renamed(value, name_of, scale, scaled=scaled, outwards=outwards)
        elif not scaled or factor == 1.0:
            found[name] = value
        else:
            found[name] = _over(value, factor) if outwards else _times(value, factor)
    return found


def _times(value: Any, factor: float) -> Any:
    """A figure, or each of several, in another unit; whatever is no figure as it is."""
    if isinstance(value, list | tuple):
        return [_times(one, factor) for one in value]
    return value * factor if isinstance(value, int | float) and not isinstance(value, bool) else value


def _over(value: Any, factor: float) -> Any:
    if factor == 1.0:
        return value
    if isinstance(value, list | tuple):
        return [_over(one, factor) for one in value]
    return float(f"{value / factor:.{DIGITS}g}") if isinstance(value, int | float) else value


def _effect_inside(effect: Mapping[str, Any], letters: Letters) -> Tables:
    on, found = effect.get("on", ""), dict(effect)
    if not isinstance(on, str):
        return found
    found["on"] = inside_column(on)
    if on in letters and isinstance(effect.get("parameters"), dict):
        found["parameters"] = _renamed(effect["parameters"], inside_name, letters[on])
    if isinstance(effect.get("table"), dict):
        inside = UNITS.get(effect.get("site", ""), ("",))[0]
        unit, factor = outside_unit(inside, scale_on(on, letters)) if is_on(on, letters) else (inside, 1.0)
        factor = factor if effect.get("unit", unit) == unit else 1.0
        found |= {"unit": inside} if effect.get("unit") == unit else {}
        found["table"] = {
            _argument(column, on, letters, TURNING, inside_name): _times(values, factor) if column in FIGURES else values
            for column, values in effect["table"].items()
        }
    return found


def _effect_outside(effect: Mapping[str, Any], letters: Letters) -> Tables:
    on, found = effect.get("on", ""), dict(effect)
    if on:
        found["on"] = outside_names(on, letters)
    if on in letters and "parameters" in effect:
        found["parameters"] = _renamed(effect["parameters"], outside_name, letters[on], outwards=True)
    if "table" in effect:
        inside = effect.get("unit") or UNITS[effect["site"]][0]
        found["table"] = term_outside(effect["table"], on, inside, letters)
        if effect.get("unit") and is_on(on, letters):
            found["unit"] = outside_unit(inside)[0]
    return found


def _argument(
    column: str, on: str, letters: Letters, of_axis: Collection[str], name_of: Callable[[str], tuple[str, float]]
) -> str:
    """A column of a learned term: of its own axis, of another one, or of neither."""
    letter, _, rest = column.partition("_")
    if rest in of_axis:
        return f"{letter}_{name_of(rest)[0]}" if letter in letters else column
    return name_of(column)[0] if column in of_axis and is_on(on, letters) else column
