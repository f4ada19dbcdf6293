"""One seed: a plant lives with its faults, comes to rest, and is judged."""

from collections import Counter
from dataclasses import dataclass

from tests.plant.simulation.defects import options_of, put_in
from tests.plant.simulation.faults import Fault, drawn
from tests.plant.simulation.invariants import Invariants
from tests.plant.simulation.mischief import Mischief, heal
from tests.plant.simulation.plant import FAULTS_UNTIL_S, LOOK_S, QUIET_S_MAX, RUN_S, plant_of

QUIET_S = 8.0
"""So long nothing may be on its way before a plant is judged."""


@dataclass(frozen=True, slots=True)
class Result:
    """The result of a seed. `digest`: a hash over all that happened on the broker and to the processes."""

    seed: int
    digest: str
    events: int
    faults: tuple[Fault, ...]
    injected: Counter[str]
    violations: tuple[str, ...]
    seconds: float  # of the plant's time
    notified: int

    @property
    def report(self) -> str:
        """Return what a person needs: the seed, its faults, the invariants, and the command that replays it."""
        lines = [f"seed {self.seed}: {len(self.violations)} violations, {self.events} events, hash {self.digest}"]
        lines += [f"  fault      {fault}" for fault in self.faults]
        lines += [f"  VIOLATED   {violation}" for violation in self.violations]
        return "\n".join([*lines, f"  replay: python benchmarks/plant_seeds.py --replay {self.seed}"])


def lived(
    seed: int, *, defect: str | None = None, without: frozenset[str] = frozenset(), faults: tuple[Fault, ...] | None = None
) -> Result:
    """Run a seed.

    defect: one of DEFECTS, put back in; without: kinds of faults that are left out; faults: these instead of those that it draws
    """
    chosen = tuple(drawn(seed, FAULTS_UNTIL_S, without)) if faults is None else faults
    with put_in(defect), plant_of(seed, **options_of(defect)) as plant:
        kernel = plant.kernel
        invariants = Invariants(plant)
        Mischief(plant, list(chosen))
        plant.begin()
        kernel.run(RUN_S + 3.0)
        heal(plant)
        until_s = kernel.now_s + QUIET_S_MAX
        quiet_s = 0.0
        while kernel.now_s < until_s and quiet_s < QUIET_S:  # what is resolved is told a while later
            kernel.run(kernel.now_s + LOOK_S)
            quiet_s = quiet_s + LOOK_S if invariants.is_quiet() else 0.0
        invariants.judge()
        return Result(
            seed,
            kernel.digest,
            kernel.notes,
            chosen,
            plant.injected,
            tuple(kernel.violations),
            kernel.now_s,
            plant.receiver.arrived.total(),
        )


def shrunk(result: Result, defect: str | None = None) -> Result:
    """Leave out one fault after the other as long as the same invariant is violated; the run with those that are left."""
    broken = {invariant_of(violation) for violation in result.violations}
    for fault in result.faults:
        fewer = tuple(one for one in result.faults if one is not fault)
        again = lived(result.seed, defect=defect, faults=fewer)
        if broken & {invariant_of(violation) for violation in again.violations}:
            result = again
    return result


def invariant_of(violation: str) -> str:
    """Return the invariant that a violation names."""
    return violation.split(": ")[1]
