"""A machine written back as `machine.toml`; beside the reading of one, since only writing needs a package of the extra `twin`."""

import tomli_w

from twin.machine import MachineFile
from twin.rotary_tables import tables_outside


def machine_to_toml(machine: MachineFile) -> str:
    """The machine as TOML, sections without values left out. Reading it back gives the same machine.

    >>> from twin.machine import machine_from_toml
    >>> text = "[machine]\\nname = 'a'\\n[spindle]\\nrated_power_kw = 11.0\\nefficiency = 0.85"
    >>> machine = machine_from_toml(text)
    >>> machine_from_toml(machine_to_toml(machine)) == machine
    True
    """
    values = machine.model_dump(mode="json", exclude_none=True)
    learned = [{key: value for key, value in term.items() if value not in ("", [])} for term in values.pop("learned")]
    values["effects"] += learned
    if machine.rotary:
        values = tables_outside(values, machine.rotary)
    values["control"] = {key: value for key, value in values["control"].items() if value not in ({}, [])}
    return tomli_w.dumps({key: value for key, value in values.items() if value not in ({}, [])}, multiline_strings=False)
