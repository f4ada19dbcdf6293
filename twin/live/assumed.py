"""The spindle that is assumed of a machine that nobody has described: constants of a usual machining centre, for trends only.

Whatever rests on one of them says so.
"""

from collections.abc import Iterable

from twin.assumed import is_assumed
from twin.machine import MachineFile, SpindleDrive, Thermal

THERMAL = Thermal(alpha_w_per_pct_rpm2=1.8e-8, beta_w_per_rpm=1.2e-3, resistance_k_per_w=0.18, capacity_j_per_k=14_500.0)
SPINDLE = SpindleDrive(rated_power_kw=15.0, efficiency=0.85, idle_power_kw=0.0)
TOOL_DIAMETER_MM = 12.0


def completed(machine: MachineFile, section: str) -> MachineFile:
    """Return the machine with the assumed section, and marked so, where it has none: `thermal` or `spindle`.

    >>> from twin.machine import Machine
    >>> completed(MachineFile(machine=Machine(name="vmc")), "spindle").machine.assumed
    ('spindle',)
    """
    if getattr(machine, section) is not None:
        return machine
    head = machine.machine.model_copy(update={"assumed": (*machine.machine.assumed, section)})
    return machine.model_copy(update={"machine": head, section: {"thermal": THERMAL, "spindle": SPINDLE}[section]})


def assumed_of(machine: MachineFile, section: str, constants: Iterable[str]) -> tuple[str, ...]:
    """Return those of the constants of a section that are assumed.

    >>> from twin.machine import Machine
    >>> vmc = MachineFile(machine=Machine(name="vmc", assumed=("spindle.efficiency",)))
    >>> assumed_of(vmc, "spindle", ["rated_power_kw", "efficiency"])
    ('efficiency',)
    """
    return tuple(name for name in constants if is_assumed(machine, f"{section}.{name}"))
