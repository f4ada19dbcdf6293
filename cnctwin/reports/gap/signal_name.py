"""Names of signals, regimes and effects as a person reads them, and the unit in which a gap is shown.

>>> signal_name("z_torque_a"), signal_name("force_x_n"), effect_name("direction_friction", "z")
('Z torque', 'Force X', 'Direction friction on Z')
"""

import importlib
import re
from collections.abc import Iterable

from twin.effects.catalogue import catalogue
from twin.effects.effect import Effect
from twin.rotary import inside_column
from twin.runlog import AXIS_COLUMN

_OF_AXIS = {"pos_mm": "position", "table_mm": "table position", "torque_a": "torque", "ref_mm": "reference"}
_OTHER = {
    "force_x_n": "Force X",
    "force_y_n": "Force Y",
    "spindle_load_pct": "Spindle load",
    "spindle_temp_c": "Spindle temperature",
    "spindle_power_kw": "Spindle power",
    "spindle_rpm": "Spindle speed",
    "vibration_rms_g": "Vibration",
    "program_time_s": "Program time",
    "spindle_angle_rad": "Spindle angle",
    "axial_depth_mm": "Axial depth",
    "entry_angle_rad": "Entry angle",
    "exit_angle_rad": "Exit angle",
}
_REGIMES = (
    *("rest", "reversal", "acceleration", "constant speed −", "constant speed +", "rapid"),
    *("cutting", "air", "spindle ramp", "dwell", "tool change", "warm-up", "cool-down", "run"),
)
_SHOWN = {
    "mm": (1000.0, "µm"),
    "deg": (1000.0, "mdeg"),
    "°C": (1.0, "K"),
    "c": (1.0, "K"),
    "C": (1.0, "K"),
    "a": (1.0, "A"),
    "n": (1.0, "N"),
}


def signal_name(signal: str) -> str:
    """A column of a run log in words; one that is not known, as it is."""
    if match := AXIS_COLUMN.match(inside_column(signal)):
        return f"{match[1].upper()} {_OF_AXIS[match[2]]}"
    return _OTHER.get(signal, signal)


def is_position(signal: str) -> bool:
    """Return True if its gap is micrometres in strokes of hundreds of millimetres, not to be seen in the signal itself."""
    return inside_column(signal).endswith(("_pos_mm", "_table_mm"))


def is_of_axis(signal: str) -> bool:
    """Return True if it is a column of an axis."""
    return AXIS_COLUMN.match(inside_column(signal)) is not None


def gap_unit(unit: str) -> tuple[float, str]:
    """By what a gap in `unit` is multiplied to be read, and the unit it then has."""
    return _SHOWN.get(unit, (1.0, unit))


def regime_name(regime: str) -> str:
    """A regime with a true minus sign."""
    return re.sub(r" -$", " −", regime)


def in_order_of_regimes(regimes: Iterable[str]) -> list[str]:
    """The known regimes in their order, then the others as they came."""
    given = list(dict.fromkeys(regimes))
    return sorted(given, key=lambda r: _REGIMES.index(regime_name(r)) if regime_name(r) in _REGIMES else len(_REGIMES))


def in_order_of_signals(signals: Iterable[str]) -> list[str]:
    """Axes by letter, of each its position, table position and torque; then force, load and temperature; then the others."""
    columns = (*_OF_AXIS, *_OTHER)

    def place(signal: str) -> tuple[int, str, int]:
        match = AXIS_COLUMN.match(inside_column(signal))
        if match:
            return 0, match[1], columns.index(match[2])
        return 1, "", columns.index(signal) if signal in columns else len(columns)

    return sorted(dict.fromkeys(signals), key=place)


def effect_name(effect: str, on: str = "") -> str:
    """An effect and what it is put on."""
    phrase = effect_phrase(effect, on)
    return phrase[:1].upper() + phrase[1:]


def effect_phrase(effect: str, on: str = "") -> str:
    """The same within a sentence."""
    plain = effect.replace("_", " ")
    return f"{plain} on {on.upper() if len(on) <= 2 else signal_name(on)}" if on else plain


def effect_words(name: str) -> tuple[str, Effect | None]:
    """Return an effect in words for a sentence, and the effect; of one that the catalogue does not have, neither.

    The sentence is the first one of the effect's file: a file begins with what it is.
    """
    effect = catalogue().get(name)
    if effect is None:
        return "", None
    text = importlib.import_module(f"twin.effects.{name}").__doc__ or ""
    return " ".join(text.split("\n\n")[0].split()), effect
