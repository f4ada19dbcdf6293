"""The control needs a time for each block, and a block cannot be travelled faster than the next one is ready.

v ≤ L / (t_stated + t)   for every cutting block of length L
"""

from twin.effects.effect import Effect, Excitation, On, Parameter
from twin.sites import Site


def block_time_s(stated_s: float, block_s: float) -> float:
    """No cutting block takes less."""
    return stated_s + block_s


EFFECT = Effect(
    name="block_overhead",
    says="each block takes the control its time",
    site=Site.PROGRAM,
    on=On.MACHINE,
    parameters=(Parameter("block_s", "s", 0.0, 0.0, 2.0, 0.02, "least time of a cutting block, beyond what is stated"),),
    changes={"block_time_s": block_time_s},
    shows_in=("line", "feed_mm_min"),
    excited_by=Excitation.SHORT_BLOCKS,
    equation="v ≤ L / (t_stated + t) for every cutting block of length L",
    reference="block processing time, as makers of controls state it; length over it is the highest feed of short blocks",
)
