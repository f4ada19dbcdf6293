"""Rotary axes: names and units outside, in degrees and N m, and inside, in mm and N.

A point that is 180/π mm from the centre of a rotary axis moves 1 mm for each degree. Inside the twin a rotary axis is that
point, so all physics, effects and bounds of linear axes hold for it, at sizes that a machine shows:

    1 deg = 1 mm,   F = T · 1000 π / 180: 1 N m = 17.45 N,   m = J · (1000 π / 180)²: 1 kg m² = 304.6 kg

Files, columns and answers have degrees; this module alone knows how one becomes the other.
"""

import math
import re
from collections.abc import Collection, Mapping
from typing import Any

from twin.errors import MachineError
from twin.learned.sites import UNITS as UNITS_OF_TERMS
from twin.learned.words import OF_AXIS, LearnedSite

PER_NM = 1000.0 * math.pi / 180.0
"""N for each N m, and the square root of kg for each kg m²."""
ENDINGS = (
    ("_n_s_per_mm", "_nm_s_per_deg", PER_NM),
    ("_n_per_mm", "_nm_per_deg", PER_NM),
    ("_per_mm", "_per_deg", 1.0),
    ("_mm_s2", "_deg_s2", 1.0),
    ("_mm_s", "_deg_s", 1.0),
    ("_mm", "_deg", 1.0),
    ("_kg", "_kg_m2", PER_NM**2),
    ("_n", "_nm", PER_NM),
    ("um_per_k", "deg_per_k", 1000.0),
)
"""Ending of a name inside, outside, and how many units inside one outside is."""
UNITS = {
    "mm": ("deg", 1.0),
    "µm": ("deg", 1000.0),
    "mm/s": ("deg/s", 1.0),
    "mm/min": ("deg/min", 1.0),
    "mm/s²": ("deg/s²", 1.0),
    "µm/K": ("deg/K", 1000.0),
    "N": ("N m", PER_NM),
    "N/mm": ("N m/deg", PER_NM),
    "N·s/mm": ("N m s/deg", PER_NM),
    "kg": ("kg m²", PER_NM**2),
    "A/mm": ("A/deg", 1.0),
    "A·s/mm": ("A·s/deg", 1.0),
}
"""Unit inside → outside, and how many inside one outside is."""
VALUES = ("value", "low", "high")
"""Columns of the table of a learned term that are in the unit of its site."""
WORDS = (("force_", "torque_"), ("mass_", "inertia_"))
"""Beginning of a name of a force or a mass inside, outside."""
COLUMN = re.compile(r"^([a-z][a-z0-9]?)_(ref|pos|table)_deg$")
ON_AXIS = re.compile(r"\b([a-z][a-z0-9]?)_(ref|pos|table)_mm\b")
LETTER = re.compile(
    r"(?<!\d )\b([A-Z][0-9]?)\b|\b(?:axis |on |axes\.)([a-z][a-z0-9]?)\b"
    r"|\b([a-z][a-z0-9]?)_(?:(?:ref|pos|table)_(?:mm|deg)|torque_a)\b"
)
NUMBER = r"[−+-]?\d[\d.,]*(?:e[−+-]?\d+)?"
FIGURES = re.compile(
    rf"({NUMBER}(?:(?: ± | to | and |, ){NUMBER})*) ({'|'.join(sorted(map(re.escape, UNITS), key=len, reverse=True))})"
    r"(?![\w/·²]| m(?![a-z]))"
)
NAME = re.compile(
    r"(?<![\w.])(?!force_[xy]_n|[a-z][a-z0-9]?_(?:ref|pos|table)_mm)[a-z][a-z_]*_(?:mm_s2|mm_s|mm|n|kg)(?![\w.])|\bum_per_k\b"
)
PATH = re.compile(r"\b(?:axes|effects)(?:\.\w+){2,}")
DIGITS = 12
"""Digits with which a figure is written, so that a file that was read is written as it was."""


def outside_name(name: str) -> tuple[str, float]:
    """Return the name of a figure of a rotary axis, and how many units inside one of its units is.

    >>> outside_name("stribeck_velocity_mm_s"), outside_name("torque_limit_a")
    (('stribeck_velocity_deg_s', 1.0), ('torque_limit_a', 1.0))
    >>> name, newton = outside_name("force_per_command_n")
    >>> name, round(newton, 3)
    ('torque_per_command_nm', 17.453)
    """
    for inside, outside, factor in ENDINGS:
        if name.endswith(inside):
            stem = name.removesuffix(inside)
            for own, other in WORDS:
                if factor != 1.0 and f"{stem}_".startswith(own):
                    stem = other[:-1] + stem[len(own) - 1 :]
            return stem + outside, factor
    return name, 1.0


def inside_name(name: str) -> tuple[str, float]:
    """Return the name inside of a figure of a rotary axis, and how many units inside one of its units is.

    >>> inside_name("inertia_kg_m2")[0], inside_name("coulomb_nm")[0], inside_name("position_gain_per_s")[0]
    ('mass_kg', 'coulomb_n', 'position_gain_per_s')
    """
    for inside, outside, factor in ENDINGS:
        if name.endswith(outside):
            stem = name.removesuffix(outside)
            for own, other in WORDS:
                if factor != 1.0 and f"{stem}_".startswith(other):
                    stem = own[:-1] + stem[len(other) - 1 :]
            return stem + inside, factor
    return name, 1.0


def outside_unit(unit: str) -> tuple[str, float]:
    """Return the unit of a figure of a rotary axis, and how many units inside it is.

    >>> outside_unit("mm"), outside_unit("A")
    (('deg', 1.0), ('A', 1.0))
    """
    return UNITS.get(unit, (unit, 1.0))


def inside_column(name: str) -> str:
    """Return the name that a column of a run log has inside.

    >>> inside_column("b_pos_deg"), inside_column("x_pos_mm")
    ('b_pos_mm', 'x_pos_mm')
    """
    return f"{name.removesuffix('_deg')}_mm" if COLUMN.match(name) else name


def outside_names(text: str, letters: Collection[str]) -> str:
    """Return a column, or a text with columns in it, with those of the rotary axes in degrees.

    >>> outside_names("b_pos_mm and x_pos_mm", {"b"})
    'b_pos_deg and x_pos_mm'
    """
    return ON_AXIS.sub(lambda m: f"{m[1]}_{m[2]}_deg" if m[1] in letters else m[0], text)


def outside_path(path: str, letters: Collection[str]) -> str:
    """Return the path of a figure in a machine file as the file has it.

    >>> outside_path("axes.b.friction.coulomb_n", {"b"}), outside_path("effects.gravity.b.force_n", {"b"})
    ('axes.b.friction.coulomb_nm', 'effects.gravity.b.torque_nm')
    """
    parts = outside_names(path, letters).split(".")
    if len(parts) > 2 and set(letters) & set(parts[1:-1]):
        parts[-1] = outside_name(parts[-1])[0]
    return ".".join(parts)


def inside_path(path: str, letters: Collection[str]) -> str:
    """Return the path of a figure of a machine file as the twin has it.

    >>> inside_path("axes.b.inertia_kg_m2", {"b"}), inside_path("axes.x.mass_kg", {"b"})
    ('axes.b.mass_kg', 'axes.x.mass_kg')
    """
    parts = [inside_column(part) for part in path.split(".")]
    if len(parts) > 2 and set(letters) & set(parts[1:-1]):
        parts[-1] = inside_name(parts[-1])[0]
    return ".".join(parts)


def outside_text(text: str, letters: Collection[str], others: Collection[str]) -> str:
    """Return a text with the figures, names and columns of rotary axes in degrees and N m.

    letters: of the rotary axes; others: of the linear ones. A clause that speaks of a linear axis keeps its units.

    >>> outside_text("gravity on B (349 ± 17 N); backlash on X (3.3 µm)", {"b"}, {"x"})
    'gravity on B (20 ± 0.97 N m); backlash on X (3.3 µm)'
    >>> outside_text("mean +3.3 µm at 12 mm/s in b_pos_mm", {"b"}, {"x"})
    'mean +0.0033 deg at 12 deg/s in b_pos_deg'
    """
    clauses = re.split(r"(; |\. )", text)
    told = "".join(_clause(clause, set(letters), set(others)) for clause in clauses)
    return PATH.sub(lambda match: outside_path(match[0], letters), outside_names(told, letters))


def _clause(clause: str, letters: set[str], others: set[str]) -> str:
    """A clause with the figures and names of rotary axes as they are outside, where it speaks of no linear one."""
    spoken_of = {next(group for group in match.groups() if group).lower() for match in LETTER.finditer(clause)}
    if spoken_of & others or (others and not spoken_of & letters):
        return clause
    clause = FIGURES.sub(_figures, clause)
    return NAME.sub(lambda match: outside_name(match[0])[0], clause)


def _figures(match: re.Match[str]) -> str:
    unit, factor = UNITS[match[2]]
    numbers = match[1] if factor == 1.0 else re.sub(NUMBER, lambda m: _divided(m[0], factor), match[1])
    return f"{numbers} {unit}"


def _divided(number: str, factor: float) -> str:
    """A number as it stands in a text over a factor, to as many digits, at least two."""
    digits = max(2, len(re.sub(r"e.*|\D", "", number).strip("0")))
    value = float(number.replace("−", "-").replace(",", "")) / factor
    shown = f"{value:.{digits}g}".replace("-", "−" if "−" in number else "-")
    return f"+{shown}" if number.startswith("+") else shown


def tables_inside(tables: Mapping[str, Any], *, scaled: bool = True) -> dict[str, Any]:
    """Return the tables of a machine file with its rotary axes as they are inside.

    scaled: whether figures become those of the units inside; without it a fault can be told in the figures of the file

    Raises MachineError where an axis has keys of both kinds.
    """
    axes = tables.get("axes")
    letters = (
        {a for a, axis in axes.items() if isinstance(axis, dict) and _is_rotary(a, axis)} if isinstance(axes, dict) else set()
    )
    found = dict(tables)
    if isinstance(found.get("noise"), dict):
        found["noise"] = {("disturbance_force_n" if k == "disturbance_torque_nm" else k): v for k, v in found["noise"].items()}
        if "disturbance_torque_nm" in tables["noise"]:
            found["noise"]["disturbance_force_n"] = _times(tables["noise"]["disturbance_torque_nm"], PER_NM if scaled else 1.0)
    if not letters:
        return found
    found["axes"] = {
        a: _axis(axis, inside_name, scaled) | {"is_rotary": True} if a in letters else axis for a, axis in axes.items()
    }
    if isinstance(found.get("uncertainty"), dict):
        found["uncertainty"] = {inside_path(path, letters): value for path, value in found["uncertainty"].items()}
    if isinstance(found.get("effects"), list):
        found["effects"] = [_effect_inside(e, letters) if isinstance(e, dict) else e for e in found["effects"]]
    return found


def tables_outside(tables: Mapping[str, Any], letters: Collection[str]) -> dict[str, Any]:
    """Return the tables of a machine, as they are inside, as its file has them. letters: of its rotary axes."""
    found = dict(tables)
    letters = set(letters)
    found["axes"] = {
        a: _axis(axis, outside_name, scaled=True, divided=True) if a in letters else axis for a, axis in tables["axes"].items()
    }
    noise = dict(tables.get("noise", {}))
    if "disturbance_force_n" in noise and letters == set(tables["axes"]):
        noise["disturbance_torque_nm"] = _times(noise.pop("disturbance_force_n"), 1.0 / PER_NM)
    found["noise"] = noise
    found["uncertainty"] = {outside_path(path, letters): value for path, value in tables.get("uncertainty", {}).items()}
    found["effects"] = [_effect_outside(effect, letters) for effect in tables.get("effects", [])]
    found["learned"] = [_term_outside(term, letters) for term in tables.get("learned", [])]
    return found


def _is_rotary(letter: str, axis: Mapping[str, Any]) -> bool:
    friction = axis.get("friction")
    keys = [*axis, *(friction if isinstance(friction, dict) else ())]
    rotary = [key for key in keys if inside_name(key)[0] != key]
    linear = [key for key in keys if outside_name(key)[0] != key or key == "torque_constant_nm_per_a"]
    if "is_rotary" in axis:
        raise MachineError(f"axes.{letter}.is_rotary is not known; an axis with inertia_kg_m2 is a rotary one")
    if rotary and linear:
        raise MachineError(f"axes.{letter} has {rotary[0]} of a rotary axis and {linear[0]} of a linear one; state one kind")
    return bool(rotary)


def _axis(axis: Mapping[str, Any], name_of: Any, scaled: bool, *, divided: bool = False) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in axis.items():
        name, factor = name_of(key)
        if isinstance(value, dict):
            found[name] = _axis(value, name_of, scaled, divided=divided)
        else:
            found[name] = _times(value, 1.0 / factor if divided else factor) if scaled and factor != 1.0 else value
    return found


def _times(value: Any, factor: float) -> Any:
    """A figure, or one for each direction, in another unit; whatever is no figure as it is."""
    if isinstance(value, list | tuple):
        return [_times(one, factor) for one in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return float(f"{value * factor:.{DIGITS}g}") if factor < 1.0 else value * factor


def _effect_inside(effect: Mapping[str, Any], letters: Collection[str]) -> dict[str, Any]:
    if isinstance(effect.get("table"), dict):
        return _term_inside(effect, letters)
    on = effect.get("on")
    found = dict(effect)
    if isinstance(on, str):
        found["on"] = inside_column(on)
    if on in letters and isinstance(effect.get("parameters"), dict):
        found["parameters"] = _axis(effect["parameters"], inside_name, scaled=True)
    return found


def _term_inside(term: Mapping[str, Any], letters: Collection[str]) -> dict[str, Any]:
    """A learned term as it is inside; one on a rotary axis is in its own unit unless another one is stated."""
    on, site = inside_column(str(term.get("on", ""))), term.get("site")
    table = {inside_name(column)[0]: values for column, values in term["table"].items()}
    found = {**term, "table": table, **({"on": on} if "on" in term else {})}
    if site not in UNITS_OF_TERMS or not _is_on(on, letters):
        return found
    inside = UNITS_OF_TERMS[LearnedSite(site)][0]
    outside, factor = outside_unit(inside)
    if term.get("unit", outside) != outside:
        raise MachineError(
            f"the learned term at {site} on {on} is in {term['unit']}; that axis turns, so it has to be in {outside}"
        )
    scaled = {name: _times(values, factor) if factor != 1.0 and name in VALUES else values for name, values in table.items()}
    return found | {"table": scaled} | ({"unit": inside} if "unit" in term else {})


def _term_outside(term: Mapping[str, Any], letters: Collection[str]) -> dict[str, Any]:
    own = _is_on(term.get("on", ""), letters)
    unit, factor = outside_unit(UNITS_OF_TERMS[LearnedSite(term["site"])][0]) if own else (term.get("unit", ""), 1.0)
    table = {}
    for column, values in term["table"].items():
        letter, _, rest = column.partition("_")
        turned = letter in letters if rest in OF_AXIS else own
        table[outside_name(column)[0] if turned and column not in VALUES else column] = (
            _times(values, 1.0 / factor) if factor != 1.0 and column in VALUES else values
        )
    return {**term, "on": outside_names(term.get("on", ""), letters), "table": table} | (
        {"unit": unit} if term.get("unit") else {}
    )


def _is_on(on: str, letters: Collection[str]) -> bool:
    """Return True where a term is on one of these axes, or on a signal of one."""
    return on.partition("_")[0] in letters


def _effect_outside(effect: Mapping[str, Any], letters: Collection[str]) -> dict[str, Any]:
    found = dict(effect) | {"on": outside_names(effect.get("on", ""), letters)}
    if effect.get("on") in letters and "parameters" in effect:
        found["parameters"] = _axis(effect["parameters"], outside_name, scaled=True, divided=True)
    return found
