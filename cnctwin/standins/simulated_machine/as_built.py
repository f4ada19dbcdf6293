"""The machine as it really is: what `machine.toml` tells, and where it is otherwise, what `as_built.toml` says."""

import tomllib
from typing import Any

from cnctwin.standins.simulated_machine.description import AS_BUILT, TOLD
from twin.machine import AddedEffect, MachineFile


def machine_as_built(hidden: AddedEffect | None = None) -> MachineFile:
    """The machine that is simulated. hidden: an effect that it has besides"""
    told, built = (tomllib.loads(path.read_text(encoding="utf-8")) for path in (TOLD, AS_BUILT))
    machine = MachineFile.model_validate(_over(told, built))
    return machine if hidden is None else machine.model_copy(update={"effects": (*machine.effects, hidden)})


def _over(told: dict[str, Any], built: dict[str, Any]) -> dict[str, Any]:
    """The one table with the values of the other laid over it.

    >>> _over({"spindle": {"efficiency": 0.85, "rated_power_kw": 7.5}}, {"spindle": {"efficiency": 0.83}})
    {'spindle': {'efficiency': 0.83, 'rated_power_kw': 7.5}}
    """
    laid = {key: _over(told[key], value) if isinstance(told.get(key), dict) else value for key, value in built.items()}
    return told | laid
