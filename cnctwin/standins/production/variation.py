"""The variation of a healthy machine from day to day and part to part, of which no description tells."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Variation:
    """Sizes of what varies, one standard deviation each unless it says otherwise. All 0: every part is like the one before.

    material: of the cutting power of a lot, relative; wear: by which it grows over the life of a tool, relative
    tool_life_parts: parts until the tools are replaced
    idle_kw: of the idle power from hour to hour; cold_grease_kw: what a cold spindle takes more, gone with a time constant of
        20 min of turning
    change_s: of the length of a tool change, which also depends on the way of the magazine
    rpm: of the shown spindle speed
    ambient_day_k, ambient_week_k, ambient_season_k: amplitudes of the air over a day, from day to day, over a quarter
    ambient_reading_k: of the air at the spindle against the thermometer, from hour to hour
    """

    material: float = 0.02
    wear: float = 0.08
    tool_life_parts: int = 240
    idle_kw: float = 0.003
    cold_grease_kw: float = 0.01
    change_s: float = 0.08
    rpm: float = 0.7
    ambient_day_k: float = 2.5
    ambient_week_k: float = 1.0
    ambient_season_k: float = 4.0
    ambient_reading_k: float = 0.15


USUAL = Variation()
NONE = Variation(0.0, 0.0, 240, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No variation: for tests of one thing."""
