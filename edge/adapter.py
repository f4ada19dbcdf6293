"""The declaration of an edge adapter, and how adapters are found.

An adapter is a file `edge/controls/<name>.py` that ends in `ADAPTER = Adapter(...)`, with its sample configuration `<name>.toml`
beside it, or a folder `edge/controls/<name>/` with both, the declaration in `adapter.py`. `parse` is a pure function from a
cursor and the bytes of one frame to the next cursor and what the frame gave; all I/O is in the connection that `connect` opens. A
cursor is a frozen value of plain fields, so it can be compared, kept as JSON and played back.
"""

import importlib
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from pydantic import BaseModel

import edge.controls
from edge.chosen import Chosen
from edge.config import EdgeConfig
from edge.errors import ConfigError
from edge.place import Place
from edge.sample import SampleSet


class Connection(Protocol):
    """The thin side of an adapter. It ends when it is closed, and it blocks for no longer than its own timeouts."""

    reconnects: int
    last_error: str

    def frames(self) -> Iterator[bytes]:
        """Raw frames, reconnecting by itself, until `close`."""

    def follow(self, cursor: Any) -> None:
        """Told after each frame where the parser stands; what is asked for next depends on it."""

    def silent_s(self) -> float:
        """Seconds since the control was last heard."""

    def close(self) -> None:
        """End `frames`, from any thread."""


class Wait(NamedTuple):
    """Nothing comes until `sock` can be read, or `seconds` have passed. Without a socket: what follows blocks."""

    sock: socket.socket | None
    seconds: float = 0.0


@runtime_checkable
class SteppedConnection(Connection, Protocol):
    """A connection that says where it would wait, so that one thread can serve many."""

    def steps(self) -> Iterator[bytes | Wait]:
        """`frames`, with the waits between them. It blocks only after a Wait without a socket, and at its beginning."""


@dataclass(frozen=True, slots=True)
class Row:
    """One signal as `check` shows it: where it comes from, in which unit, and its value now."""

    signal: str
    source: str
    unit: str
    native_unit: str
    value: str | int | float | bool | None
    reason: str | None


def no_address(chosen: Chosen) -> object:
    """Refuse an address, for a control of which nothing is read by address."""
    raise ConfigError("nothing can be read by its address on this control; remove the table")


@dataclass(frozen=True, slots=True)
class Adapter:
    """One kind of control.

    `place` says up to where a cursor has taken everything (None: not begun); `resume` is `start` from such a place.
    `describe` says what would be published, asking the control but no broker; `draft` writes a configuration for the control at
    an address (and the device of that name, where it serves several), which begins with one of `schemes`. `address` reads the
    address of a chosen variable or PLC signal as this kind of control writes it, or raises ConfigError.
    """

    name: str
    schemes: tuple[str, ...]
    config_model: type[BaseModel]
    start: Callable[[EdgeConfig[Any]], Any]
    place: Callable[[Any], Place | None]
    resume: Callable[[EdgeConfig[Any], Place], Any]
    parse: Callable[[EdgeConfig[Any], Any, bytes], tuple[Any, SampleSet]]
    connect: Callable[[EdgeConfig[Any]], Connection]
    describe: Callable[[EdgeConfig[Any]], list[Row]]
    draft: Callable[[str, str], str]
    sample_config: Path
    address: Callable[[Chosen], object] = no_address


@cache
def modules() -> dict[str, str]:
    """The module that declares each adapter, by the adapter's name in alphabetical order; imports none of them."""
    folder = Path(edge.controls.__path__[0])
    found = {sample.stem: f"edge.controls.{sample.stem}" for sample in folder.glob("*.toml")}
    found |= {one.parent.name: f"edge.controls.{one.parent.name}.adapter" for one in folder.glob("*/adapter.py")}
    return dict(sorted(found.items()))


def adapters() -> dict[str, Adapter]:
    """All adapters by name."""
    return {name: find(name) for name in modules()}


def find(name: str) -> Adapter:
    """The adapter `name`; imports no other. Raises ConfigError."""
    if name not in modules():
        raise ConfigError(f"no adapter {name!r}; there are {', '.join(modules())}")
    adapter = getattr(importlib.import_module(modules()[name]), "ADAPTER", None)
    assert isinstance(adapter, Adapter) and adapter.name == name, f"{modules()[name]} declares no adapter {name!r}"
    return adapter
