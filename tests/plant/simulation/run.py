"""One seed: a plant lives with its faults, comes to rest, and is judged."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

from tests.plant.simulation.faults import Fault, drawn
from tests.plant.simulation.invariants import Invariants
from tests.plant.simulation.mischief import Mischief, heal
from tests.plant.simulation.plant import FAULTS_UNTIL_S, QUIET_S_MAX, RUN_S, plant_of

SETTLE_S = 5.0


@dataclass(frozen=True, slots=True)
class Result:
    """What a seed came to. `digest`: a hash over all that happened on the broker and to the processes."""

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


def lived(seed: int, *, without: frozenset[str] = frozenset(), faults: tuple[Fault, ...] | None = None, **options: Any) -> Result:
    """Run a seed. `without`: kinds of faults that are left out; `faults`: these instead of those that it draws."""
    chosen = tuple(drawn(seed, FAULTS_UNTIL_S, without)) if faults is None else faults
    with plant_of(seed, **options) as plant:
        kernel = plant.kernel
        invariants = Invariants(plant)
        Mischief(plant, list(chosen))
        plant.begin()
        kernel.run(RUN_S + 3.0)
        heal(plant)
        until_s = kernel.now_s + QUIET_S_MAX
        kernel.run(kernel.now_s + SETTLE_S)
        while kernel.now_s < until_s and not invariants.is_quiet():
            kernel.run(kernel.now_s + 2.0)
        kernel.run(kernel.now_s + SETTLE_S)
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
