"""Opens a store on a server by its URL (`address`); `also=<folder>` keeps an embedded store beside it."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from cnctwin.memory.store.contract import Store, StoreError
from cnctwin.memory.store.influx.address import INFLUX1, INFLUX2, SCHEMES, VICTORIA, Address, parse

if TYPE_CHECKING:
    from cnctwin.memory.store.influx.server import Server
    from cnctwin.memory.store.influx.store import ReadOnlyServer
    from cnctwin.memory.store.retention import Retention

__all__ = ["SCHEMES", "open_influx"]


def open_influx(url: str, *, writable: bool, spool: Path, retention: "Retention | None" = None) -> Store:
    """The store behind a URL; `spool` is the folder of the ring, which one writer at a time may have.

    retention: of the embedded store beside it, where there is one; the server's buckets have their own

    It opens whether the server is up or not. Raises StoreError where the URL, the token or the ring cannot be used.
    """
    from cnctwin.memory.store.influx.both import Both  # noqa: PLC0415 — httpx and the rest only where a server is named

    address = parse(url)
    store = _server_store(address, writable=writable, spool=spool)
    if address.also is None:
        return store
    try:
        from cnctwin.memory.store.embedded import EmbeddedStore  # noqa: PLC0415 — only where its folder is named

        return Both(EmbeddedStore(address.also, writable=writable, retention=retention), store)
    except BaseException:
        store.close()
        raise


def _server_store(address: Address, *, writable: bool, spool: Path) -> "ReadOnlyServer":
    from cnctwin.memory.store.influx.influx1 import Influx1  # noqa: PLC0415
    from cnctwin.memory.store.influx.influx2 import Influx2  # noqa: PLC0415
    from cnctwin.memory.store.influx.influx_reader import InfluxReader  # noqa: PLC0415
    from cnctwin.memory.store.influx.store import Reader, ReadOnlyServer, ServerStore  # noqa: PLC0415
    from cnctwin.memory.store.influx.victoria import Victoria  # noqa: PLC0415
    from cnctwin.memory.store.influx.victoria_reader import VictoriaReader  # noqa: PLC0415

    try:
        reader: Reader = VictoriaReader(address) if address.kind == VICTORIA else InfluxReader(address)
    except (OSError, ValueError) as error:
        raise StoreError(f"{address.base}: cannot be used: {error}; look at the address and at ca=…") from error
    if not writable:
        return ReadOnlyServer(reader, address.base, spool)
    servers: dict[str, Callable[[Address], Server]] = {INFLUX1: Influx1, INFLUX2: Influx2, VICTORIA: Victoria}
    return ServerStore(servers[address.kind](address), reader, address.base, spool, knows_texts=address.kind != VICTORIA)
