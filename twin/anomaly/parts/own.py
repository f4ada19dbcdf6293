"""The state of one machine between two ticks; all of it is JSON-able and bounded."""

from typing import NamedTuple

from twin.anomaly.parts.heat import Heat
from twin.anomaly.parts.levels import Levels
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.moment import Place
from twin.anomaly.parts.usual import Told, Usual

NEVER = -(10**12)


class Own(NamedTuple):
    """tick: the last one told; place: where the machine is in its part
    smooth: the residuals by scale and signal, in spreads; told: tick at which each signal was last told of
    heat: what is warm; levels: wear and material; section: sums of the section that runs; sections: those of the operation so far
    usual: the operations learned since training; waiting: of the part that runs, kept until it has ended without an alarm
    ended: the operation that has ended at this tick; is_held: a score was suspicious, so nothing is followed; high_since: since when
    """

    tick: int = NEVER
    place: Place = Place()
