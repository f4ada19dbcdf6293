"""A configuration file, read and checked."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from edge.accelerometer.section import AccelerometerSection
from edge.adapter import find, modules
from edge.chosen import PlcAddresses, Variables
from edge.config import (
    BrokerSection,
    EdgeConfig,
    MachineSection,
    ReportSection,
    SignalSection,
    StoreSection,
    ToolChangeSection,
)
from edge.config_fault import one_line
from edge.errors import ConfigError

_SECTIONS: dict[str, TypeAdapter[Any]] = {
    "machine": TypeAdapter(MachineSection),
    "broker": TypeAdapter(BrokerSection),
    "signals": TypeAdapter(dict[str, SignalSection]),
    "report": TypeAdapter(ReportSection),
    "tool_change": TypeAdapter(ToolChangeSection),
    "store": TypeAdapter(StoreSection),
    "accelerometer": TypeAdapter(AccelerometerSection),
    "variables": TypeAdapter(Variables),
    "plc": TypeAdapter(PlcAddresses),
}


def load(path: Path) -> EdgeConfig[Any]:
    """The edge that this file describes, or a ConfigError of one line."""
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
    sections = {name: _section(path, name, kind, tables.pop(name, {})) for name, kind in _SECTIONS.items()}
    chosen: str = sections["machine"].adapter
    if chosen not in modules():
        raise ConfigError(f"{path}: machine.adapter = {chosen!r}: no such adapter; there are {', '.join(modules())}")
    adapter = find(chosen)
    source = _section(path, chosen, TypeAdapter(adapter.config_model), tables.pop(chosen, {}))
    if tables:
        raise ConfigError(f"{path}: [{next(iter(tables))}]: no such table; there are {', '.join(_SECTIONS)} and {chosen}")
    config = EdgeConfig(source=source, path=path, **sections)
    for one in config.chosen:
        try:
            adapter.address(one)
        except ConfigError as error:
            raise ConfigError(f"{path}: {one.table}.address: {error}") from error
    return config


def _check_adapter_is_stated(tables: dict[str, Any], path: Path) -> None:
    """Refuse a file that holds nothing, and one with the table of a control that [machine] does not name."""
    if not tables:
        raise ConfigError(f"{path}: is empty; cnctwin edge discover ADDRESS > {path.name} drafts it")
    machine = tables.get("machine", {})
    default = MachineSection().adapter
    named = next((name for name in tables if name in modules() and name != default), None)
    if named is not None and default not in tables and isinstance(machine, dict) and "adapter" not in machine:
        raise ConfigError(f'{path}: machine.adapter is missing; [{named}] needs adapter = "{named}" below [machine]')


def _section(path: Path, name: str, kind: TypeAdapter[Any], raw: object) -> Any:
    try:
        return kind.validate_python(raw)
    except ValidationError as error:
        raise ConfigError(one_line(path, name, error)) from error
