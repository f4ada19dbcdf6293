"""Open a store, wherever it lies: a folder is the embedded one, an address with a scheme a server."""

import os
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Store, StoreError
from cnctwin.memory.store.retention import Retention
from edge.state_dir import state_dir

VARIABLE = "CNCTWIN_STORE"


def default_place() -> str:
    """$CNCTWIN_STORE, a folder or an address; else `store` in the folder where commands keep what has to survive a restart."""
    return os.environ.get(VARIABLE) or str(state_dir() / "store")


def open_store(where: str | Path, *, writable: bool = False, retention: Retention | None = None) -> Store:
    """The store at `where`. Only one process may have it open for writing.

    retention: of a writer; None: what the store was told last. Raises StoreError in one line.
    """
    text = str(where)
    scheme, colon, _ = text.partition("://")
    if colon and isinstance(where, str):
        from cnctwin.memory.store.influx.opening import SCHEMES, open_influx  # noqa: PLC0415

        if scheme not in SCHEMES:
            # The address may hold a password: only its scheme is repeated.
            raise StoreError(f"there is no store of the kind {scheme}://; give a folder, or {', '.join(SCHEMES)}://…")
        return open_influx(text, writable=writable, spool=state_dir() / "influx", retention=retention)
    from cnctwin.memory.store.embedded import EmbeddedStore  # noqa: PLC0415

    return EmbeddedStore(Path(where), writable=writable, retention=retention)


def check_machine(store: Store, machine: str) -> None:
    """Raises UsageError, with the machines there are, where the store has none of this name."""
    if machine not in (known := store.machines()):
        raise UsageError(f"{machine}: the store has no such machine; it has {', '.join(known) or 'none'}")
