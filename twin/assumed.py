"""The constants that are only assumed, until recordings tell them: `assumed` of [machine].

A constant leaves the list where it was fitted to within USEFUL of its value, a section where none of its constants is left.
Temperatures tell heat and resistance only over the capacity, and loads tell powers only over the rated power: these two are the
measure of the others, and leave with them.
"""

from collections.abc import Mapping

from twin.machine import MachineFile

USEFUL = 0.15
"""One relative standard deviation up to which a fitted constant is of use."""
MEASURES = {
    "thermal.capacity_j_per_k": ("thermal.alpha_w_per_pct_rpm2", "thermal.beta_w_per_rpm", "thermal.resistance_k_per_w"),
    "spindle.rated_power_kw": ("spindle.efficiency", "spindle.idle_power_kw"),
}
"""A constant that recordings cannot tell → the constants that hold with it."""


def is_assumed(machine: MachineFile, path: str) -> bool:
    """Return True where a constant, or its whole section, is only assumed.

    >>> from twin.machine import machine_from_toml
    >>> machine = machine_from_toml('[machine]\\nname = "a"\\nassumed = ["thermal", "spindle.efficiency"]')
    >>> is_assumed(machine, "thermal.beta_w_per_rpm"), is_assumed(machine, "spindle.idle_power_kw")
    (True, False)
    """
    return any(path == one or path.startswith(f"{one}.") for one in machine.machine.assumed)


def with_fitted(machine: MachineFile, deviations: Mapping[str, float]) -> MachineFile:
    """Return the machine without what recordings tell among its assumptions. deviations: path → relative standard deviation"""
    told = {path for path, deviation in deviations.items() if deviation <= USEFUL}
    told |= {path for path, others in MEASURES.items() if _there(machine, others) and _there(machine, others) <= told}
    left: list[str] = []
    for one in machine.machine.assumed:
        inside = _there(machine, _constants(machine, one))
        if not inside & told:
            left += [] if one in told else [one]
        else:
            left += sorted(inside - told)
    if tuple(left) == machine.machine.assumed:
        return machine
    return machine.model_copy(update={"machine": machine.machine.model_copy(update={"assumed": tuple(left)})})


def _constants(machine: MachineFile, path: str) -> tuple[str, ...]:
    """Return the paths of the numbers in a section; none where the path is no section."""
    value: object = machine.model_dump(exclude_none=True)
    for key in path.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    return tuple(_leaves(path, value)) if isinstance(value, dict) else ()


def _leaves(path: str, table: Mapping[str, object]) -> list[str]:
    found = []
    for key, value in table.items():
        found += _leaves(f"{path}.{key}", value) if isinstance(value, dict) else [f"{path}.{key}"]
    return found


def _there(machine: MachineFile, paths: tuple[str, ...]) -> set[str]:
    """Return those of the paths whose constant is not 0: one that is there is no heat and no power to be told."""
    found = set()
    for path in paths:
        value: object = machine
        for key in path.split("."):
            value = value.get(key) if isinstance(value, dict) else getattr(value, key, None)
        if value not in (0.0, None):
            found.add(path)
    return found
