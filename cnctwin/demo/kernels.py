"""Compiles the kernels that the demo needs, once on a computer: of the machine with each hidden effect, and of the diagnosis.

python -m cnctwin.demo.kernels
"""

import sys
import time
from random import Random

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.hidden_effect import hidden_effects
from cnctwin.standins.simulated_machine.machining import machined
from twin.gap.warm_kernels import warm_kernels


def main() -> None:
    """Compile them; quick where they are there already."""
    begun_s = time.monotonic()
    for hidden in hidden_effects():
        machined(1, machine_as_built(hidden.drawn(Random(0))))  # noqa: S311 — no secret
    warm_kernels()
    print(f"the kernels are compiled, in {time.monotonic() - begun_s:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
