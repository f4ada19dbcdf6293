"""A machine written back as `machine.toml`; beside the reading of one, since only writing needs a package of the extra `twin`."""

import json
from collections.abc import Mapping
from typing import Any

import tomli_w

from twin.assumption import without_assumptions
from twin.learned.section import LEARNED
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
    values = without_assumptions(machine.model_dump(mode="json", exclude_none=True))
    learned = [{key: value for key, value in term.items() if value not in ("", [])} for term in values.pop(LEARNED)]
    values["effects"] += learned
    if machine.rotary:
        values = tables_outside(values, machine.rotary)
    values["machine"] = {key: value for key, value in values["machine"].items() if value != []}
    effects, assumed = values.pop("effects"), values.pop("assumed")
    values["control"] = {key: value for key, value in values["control"].items() if value not in ({}, [])}
    text = tomli_w.dumps({key: value for key, value in values.items() if value not in ({}, [])}, multiline_strings=False)
    listed = "".join(f"{json.dumps(path)} = {_in_line(one)}\n" for path, one in assumed.items())
    return text + (f"\n[assumed]\n{listed}" if listed else "") + "".join(_entry(entry) for entry in effects)


def _entry(effect: Mapping[str, Any]) -> str:
    """An effect or a learned term, with its parameters or its table in one line."""
    return "\n[[effects]]\n" + "".join(f"{key} = {_in_line(value)}\n" for key, value in effect.items())


def _in_line(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_in_line(one)}" for key, one in value.items()) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_in_line(one) for one in value) + "]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
