"""Lost motion between motor and table: the play operator. The motor's encoder does not see it; a table-side scale does.

table = clamp(table, motor − play/2, motor + play/2)
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def table_mm(table_mm: float, engaged_mm: float, play_mm: float) -> tuple[float, float]:
    """The table, pushed along by whichever flank touches."""
    low_mm = table_mm - 0.5 * play_mm
    high_mm = table_mm + 0.5 * play_mm
    pushed_mm = engaged_mm if engaged_mm > low_mm else low_mm
    pushed_mm = pushed_mm if pushed_mm < high_mm else high_mm
    return pushed_mm, pushed_mm


EFFECT = Effect(
    name="backlash",
    says="{on} has lost motion",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(Parameter("play_mm", "mm", 0.0, 0.0, 0.5, 0.01, "whole width of the play"),),
    states={"engaged_mm": "position_mm"},
    changes={"table_mm": table_mm},
    shows_in=("{a}_table_mm",),
    likely_in={"reversal": 2, "table": 1},
    carried=("engaged_mm",),
    equation="table = clamp(table, motor − play/2, motor + play/2)",
    reference="ISO 230-2:2014, reversal value; the play operator of Krasnosel'skii and Pokrovskii 1989",
)
