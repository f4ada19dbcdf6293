"""The spindle's power: what a cut draws, and which power of the cut a limit of electrical power leaves at a speed.

P_el = P_cut / η + P_idle, with η and P_idle as the effects of the machine change them, and the most that its learned terms add.
Effects on the meter alone have no part.

Below its base speed the drive has constant torque, so that its power grows with the speed up to the rated one.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.learned.bounds import greatest
from twin.learned.knots import Knots
from twin.learned.standing import terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
PHYSICAL = frozenset({"efficiency", "idle_power_kw"})
KNOWN = ("load_pct", "spindle_rpm")
LOAD = "load_pct"
BISECTIONS = 50
KILOWATT_AS_PCT = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class SpindlePower:
    """constants: of `twin.spindle`, rated power replaced so that per cent read kW; limit_kw: at and above base_rpm

    terms: learned ones, over the speed and over the power without them (`load_kw`) at most
    """

    constants: dict[str, float]
    effects: tuple[str, ...]
    limit_kw: float
    base_rpm: float
    terms: tuple[Term, ...] = ()

    @classmethod
    def of(cls, machine: MachineFile) -> Self | None:
        """Return the power of a machine's spindle; None where it has no [spindle]."""
        if machine.spindle is None:
            return None
        changing = added_effects(machine, spindle_quantities())
        added = {effect: given for effect, given in changing.items() if set(effect_named(effect).changes) <= PHYSICAL}
        constants = spindle_constants(machine.spindle) | {"rated_power_kw": KILOWATT_AS_PCT}
        constants |= {f"{e}__{k}": v for e, given in added.items() for k, v in effect_named(e).checked(given).items()}
        asked = machine.limits.power_kw if machine.limits is not None else None
        limit = min(machine.spindle.rated_power_kw, asked if asked is not None else np.inf)
        base = machine.program.spindle_base_rpm if machine.program is not None else None
        return cls(constants, tuple(added), limit, base or 0.0, _growing(machine))

    def electrical_kw(self, cutting_w: Floats, rpm: Floats) -> Floats:
        """Return the power that the drive draws; arrays of one shape."""
        power, speed = np.broadcast_arrays(np.asarray(cutting_w, dtype=np.float64), np.asarray(rpm, dtype=np.float64))
        drawn = spindle_load_pct(self.constants, power.ravel(), speed.ravel(), period_s=1.0, effects=self.effects)[0]
        known = {"load_kw": drawn, "spindle_rpm": speed.ravel(), "time_since_start_s": np.zeros(speed.size)}
        for term in self.terms:
            drawn = drawn + term.knots.interpolated(term.value[None, :], known)[0]
        return np.asarray(drawn.reshape(power.shape))

    def allowed_kw(self, rpm: Floats) -> Floats:
        """Electrical power that may be drawn at a speed."""
        return np.asarray(self.limit_kw * (np.minimum(1.0, rpm / self.base_rpm) if self.base_rpm > 0.0 else 1.0) + 0.0 * rpm)

    def allowed_cutting_w(self, rpm: Floats) -> Floats:
        """Power of the cut that may be drawn at a speed; 0 where idling takes all of it."""
        allowed = self.allowed_kw(rpm)
        if not self.effects and not self.terms:
            left = allowed - self.constants["idle_power_kw"]
            return np.asarray(np.maximum(1000.0 * self.constants["efficiency"] * left, 0.0))
        low, high = np.zeros(np.shape(rpm)), 1000.0 * allowed
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            fits = self.electrical_kw(middle, rpm) <= allowed
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return low


def _growing(machine: MachineFile) -> tuple[Term, ...]:
    """The learned terms of the spindle's power: the greatest that each can be, and growing with the power."""
    assert machine.spindle is not None
    found = []
    for term in terms_at(machine.learned, (LearnedSite.SPINDLE_POWER,)):
        most = greatest(term, KNOWN)
        value, by_column = most.value.reshape(most.knots.shape), dict(most.knots.by_column)
        if LOAD in by_column:
            value = np.maximum.accumulate(value, axis=most.knots.columns.index(LOAD))
        rated = machine.spindle.rated_power_kw
        knots = {("load_kw" if c == LOAD else c): v * (rated / 100.0 if c == LOAD else 1.0) for c, v in by_column.items()}
        found.append(Term(term.site, term.on, Knots(knots), value.ravel(), value.ravel(), value.ravel()))
    return tuple(found)
