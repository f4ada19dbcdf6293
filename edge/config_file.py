"""A configuration file, read and checked."""

import shlex
import tomllib
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from edge.accelerometer.section import AccelerometerSection
from edge.adapter import Adapter, find, modules
from edge.chosen import PlcAddresses, Variables
from edge.config import (
    BrokerSection,
    EdgeConfig,
    MachineSection,
    ReportSection,
    SignalSection,
    StoreSection,
    ToolChangeSection,
    faults_in,
)
from edge.errors import ConfigError
from twin.vocabulary.faults import report, unknown

_SECTIONS: dict[str, Any] = {
    "machine": MachineSection,
    "broker": BrokerSection,
    "signals": dict[str, SignalSection],
    "report": ReportSection,
    "tool_change": ToolChangeSection,
    "store": StoreSection,
    "accelerometer": AccelerometerSection,
    "variables": Variables,
    "plc": PlcAddresses,
}


def load(path: Path) -> EdgeConfig[Any]:
    """The edge that this file describes, or a ConfigError with a line for each fault."""
    try:
        return parse(path.read_text(encoding="utf-8"), path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 at byte {error.start}; save it as UTF-8") from error


def parse(text: str, path: Path) -> EdgeConfig[Any]:
    """The edge that this text describes; `path` is for messages."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is no TOML: {error}") from error
    _check_adapter_is_stated(tables, path)
    faults: list[str] = []
    sections = {name: _section(name, kind, tables.pop(name, {}), faults) for name, kind in _SECTIONS.items()}
    adapter: Adapter | None = None
    source: Any = None
    if (machine := sections["machine"]) is not None:
        if machine.adapter in modules():
            adapter = find(machine.adapter)
            source = _section(machine.adapter, adapter.config_model, tables.pop(machine.adapter, {}), faults)
        else:
            faults.append(unknown(f"machine.adapter = {machine.adapter!r}", machine.adapter, modules()))
    own = () if adapter is None else (adapter.name,)
    others = tables if adapter is not None else {name: table for name, table in tables.items() if name not in modules()}
    for name in others:
        is_other_control = adapter is not None and name in modules()
        faults.append(
            f'[{name}]: is the table of another control; remove it, or write adapter = "{name}" below [machine]'
            if is_other_control
            else unknown(f"[{name}]", name, (*_SECTIONS, *own))
        )
    if adapter is None or faults:
        raise ConfigError(report(path, faults, "docs/how-to/edges.md"))
    config = EdgeConfig(source=source, path=path, **sections)
    for one in config.chosen:
        try:
            adapter.address(one)
        except ConfigError as error:
            faults.append(f"{one.table}.address: {error}")
    if faults:
        raise ConfigError(report(path, faults))
    return config


def _check_adapter_is_stated(tables: dict[str, Any], path: Path) -> None:
    """Refuse a file that holds nothing, and one with the table of a control that [machine] does not name."""
    if not tables:
        raise ConfigError(f"{path}: is empty; cnctwin edge discover ADDRESS > {shlex.quote(path.name)} drafts it")
    machine = tables.get("machine", {})
    default = MachineSection().adapter
    named = next((name for name in tables if name in modules() and name != default), None)
    if named is not None and default not in tables and isinstance(machine, dict) and "adapter" not in machine:
        raise ConfigError(f'{path}: machine.adapter is missing; [{named}] needs adapter = "{named}" below [machine]')


def _section(name: str, kind: Any, raw: object, faults: list[str]) -> Any:
    """Return a table as its model, or None with its faults added to `faults`."""
    try:
        return TypeAdapter(kind).validate_python(raw)
    except ValidationError as error:
        faults += faults_in(name, kind, error)
        return None
