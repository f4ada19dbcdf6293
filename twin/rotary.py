"""Rotary axes: names and units outside, in degrees and N m, and inside, in mm and N.

A point that is 180/π mm from the centre of a rotary axis moves 1 mm for each degree. Inside the twin a rotary axis is that
point, so all physics, effects and bounds of linear axes hold for it, at sizes that a machine shows:

    1 deg = 1 mm,   F = T · 1000 π / 180: 1 N m = 17.45 N,   m = J · (1000 π / 180)²: 1 kg m² = 304.6 kg

A wrist and the shoulder of a press robot are a thousandfold apart, and what is looked for has the size of a feed axis. Forces and
masses of an axis are therefore in units of a power of ten inside, its `scale`, which changes no motion: `letters` below has the
scale of each rotary axis by its letter.

Files, columns and answers have degrees; this module alone knows how one becomes the other.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping

USUAL = 400.0
"""Friction in N, or mass in kg, of a feed axis."""
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


Letters = Mapping[str, float]


def scale_of(coulomb_nm: float, inertia_kg_m2: float) -> float:
    """Return the scale of an axis: its Coulomb friction is a few hundred N inside, or its mass a few hundred kg without one.

    >>> scale_of(14.0, 2.5), scale_of(0.05, 0.004), scale_of(0.0, 250.0)
    (1.0, 1000.0, 0.01)
    """
    inside = PER_NM * coulomb_nm or PER_NM**2 * inertia_kg_m2
    if not (math.isfinite(inside) and inside > 0.0):
        return 1.0
    return 10.0 ** min(max(round(math.log10(USUAL / inside)), -6), 6)


def _scaled(factor: float, scale: float) -> float:
    """Return the number of units inside that one outside makes; forces and masses are in units of the scale."""
    return factor * scale if factor in (PER_NM, PER_NM**2) else factor


def outside_name(name: str, scale: float = 1.0) -> tuple[str, float]:
    """Return the name of a figure of a rotary axis, and how many units inside one of its units is.

    >>> outside_name("stribeck_velocity_mm_s"), outside_name("torque_limit_a")
    (('stribeck_velocity_deg_s', 1.0), ('torque_limit_a', 1.0))
    >>> name, newton = outside_name("force_per_command_n")
    >>> name, round(newton, 3)
    ('torque_per_command_nm', 17.453)
    """
    return _renamed(name, ENDINGS, WORDS, scale)


def inside_name(name: str, scale: float = 1.0) -> tuple[str, float]:
    """Return the name inside of a figure of a rotary axis, and how many units inside one of its units is.

    >>> inside_name("inertia_kg_m2")[0], inside_name("coulomb_nm")[0], inside_name("position_gain_per_s")[0]
    ('mass_kg', 'coulomb_n', 'position_gain_per_s')
    """
    return _renamed(name, [(outside, inside, factor) for inside, outside, factor in ENDINGS], [(b, a) for a, b in WORDS], scale)


def _renamed(
    name: str, endings: Iterable[tuple[str, str, float]], words: Iterable[tuple[str, str]], scale: float
) -> tuple[str, float]:
    """The name with another ending, and another word at its head where its unit is another one."""
    for ending, instead, factor in endings:
        if name.endswith(ending):
            stem = name.removesuffix(ending)
            for own, other in words:
                if factor != 1.0 and f"{stem}_".startswith(own):
                    stem = other[:-1] + stem[len(own) - 1 :]
            return stem + instead, _scaled(factor, scale)
    return name, 1.0


def outside_unit(unit: str, scale: float = 1.0) -> tuple[str, float]:
    """Return the unit of a figure of a rotary axis, and how many units inside it is.

    >>> outside_unit("mm"), outside_unit("A")
    (('deg', 1.0), ('A', 1.0))
    """
    outside, factor = UNITS.get(unit, (unit, 1.0))
    return outside, _scaled(factor, scale)


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


def outside_text(text: str, letters: Letters, others: Collection[str]) -> str:
    """Return a text with the figures, names and columns of rotary axes in degrees and N m.

    others: the letters of the linear axes. A clause that speaks of one of them keeps its units.

    >>> outside_text("gravity on B (349 ± 17 N); backlash on X (3.3 µm)", {"b": 1.0}, {"x"})
    'gravity on B (20 ± 0.97 N m); backlash on X (3.3 µm)'
    >>> outside_text("mean +3.3 µm at 12 mm/s in b_pos_mm", {"b": 1.0}, {"x"})
    'mean +0.0033 deg at 12 deg/s in b_pos_deg'
    """
    clauses = re.split(r"(; |\. )", text)
    told = "".join(_clause(clause, letters, set(others)) for clause in clauses)
    return PATH.sub(lambda match: outside_path(match[0], letters), outside_names(told, letters))


def _clause(clause: str, letters: Letters, others: set[str]) -> str:
    """A clause with the figures and names of rotary axes as they are outside, where it speaks of no linear one."""
    spoken_of = {next(group for group in match.groups() if group).lower() for match in LETTER.finditer(clause)}
    meant = spoken_of & letters.keys()
    if spoken_of & others or (others and not meant):
        return clause
    scales = {letters[letter] for letter in meant or letters}
    if len(scales) == 1:
        clause = FIGURES.sub(lambda match: _figures(match, next(iter(scales))), clause)
    return NAME.sub(lambda match: outside_name(match[0])[0], clause)


def _figures(match: re.Match[str], scale: float) -> str:
    unit, factor = outside_unit(match[2], scale)
    numbers = match[1] if factor == 1.0 else re.sub(NUMBER, lambda m: _divided(m[0], factor), match[1])
    return f"{numbers} {unit}"


def _divided(number: str, factor: float) -> str:
    """A number as it stands in a text over a factor, to as many digits, at least two."""
    digits = max(2, len(re.sub(r"e.*|\D", "", number).strip("0")))
    value = float(number.replace("−", "-").replace(",", "")) / factor
    shown = f"{value:.{digits}g}".replace("-", "−" if "−" in number else "-")
    return f"+{shown}" if number.startswith("+") else shown
