"""The constants that are only assumed, until recordings tell them: `assumed` of [machine].

`[assumed]` says of one in which range machines of the class have it, and where that is from (`twin.assumption`).

A constant leaves the list where it was fitted to within USEFUL of its value, a section where none of its constants is left.
Temperatures tell heat and resistance only over the capacity, and loads tell powers only over the rated power: these two are the
measure of the others, and leave with them.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

from twin.machine import MachineFile
from twin.rotary import outside_path

NAMED_MAX = 5
"""Assumptions that are listed by name; of more it is said how many each section has."""
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
    left: dict[str, str] = {}  # what stays, and what named it before
    for one in machine.machine.assumed:
        inside = _there(machine, _constants(machine, one))
        stays = sorted(inside - told) if inside & told else [] if one in told else [one]
        left |= dict.fromkeys(stays, one)
    if tuple(left) == machine.machine.assumed:
        return machine
    entries = {path: machine.assumed[before] for path, before in left.items() if before in machine.assumed}
    head = machine.machine.model_copy(update={"assumed": tuple(left)})
    return machine.model_copy(update={"machine": head, "assumed": entries})


def assumed_in_words(machine: MachineFile) -> str:
    """Return which constants of a machine are still assumed, and how many where they are many; "" where none is."""
    return listed([outside_path(path, machine.rotary) for path in machine.machine.assumed])


def listed(paths: Sequence[str]) -> str:
    """Return assumptions in words: by name, or of many how many each section has.

    >>> listed(["thermal", "spindle.efficiency"])
    'thermal, spindle.efficiency'
    >>> listed([f"axes.{axis}.{name}" for axis in "xy" for name in ("mass_kg", "torque_limit_a", "friction.coulomb_n")])
    '6 constants (axes.x 3, axes.y 3)'
    """
    if len(paths) <= NAMED_MAX:
        return ", ".join(paths)
    sections = Counter(".".join(path.split(".")[: 2 if path.startswith(("axes.", "tools.")) else 1]) for path in paths)
    return f"{len(paths)} constants ({', '.join(f'{section} {count}' for section, count in sections.items())})"


def narrowed_in_words(before: MachineFile, after: MachineFile) -> tuple[str, ...]:
    """Return what recordings have told of the constants that were assumed, and what they have not; nothing where none was."""
    if not before.machine.assumed:
        return ()
    left, still = set(after.machine.assumed), assumed_in_words(after)
    was: list[str] = []
    for one in before.machine.assumed:  # a section counts as one, unless a part of it is told
        is_parted = one not in left and any(path.startswith(f"{one}.") for path in left)
        was += _constants(before, one) if is_parted else (one,)
    told = f"{len(set(was) - left)} of {len(was)} assumed constants are known from these recordings now"
    return (f"{told}; still assumed: {still}" if still else f"{told}; nothing is assumed any more",)


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
