"""Pieces on the workers of a Dask cluster: its address, and a client that never waits for ever.

Who may connect to a Dask scheduler may run anything on its workers, and is believed. So beyond this machine an address is tls://,
with the authority, and a certificate and key by which the scheduler knows us; a plain one has to be asked for (`insecure=yes`).
"""

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from cnctwin.errors import SpreadError, UsageError
from cnctwin.jobs.piece import name_of, opened, run_piece
from sparkplug.shown_address import shown_address

_FILES = ("ca_file", "certificate_file", "key_file")
_PORT = 8786
LOOK_S = 1.0
"""Seconds between looks whether scheduler and workers are there, while an answer is awaited."""


@dataclass(frozen=True, slots=True)
class DaskCluster:
    """The address of a Dask scheduler, and the way in.

    insecure: whether a plain address of another machine is taken
    patience_s: how long the scheduler may not answer, or have no worker, before a job is given up

    >>> DaskCluster.from_text("tcp://127.0.0.1").address
    'tcp://127.0.0.1:8786'
    """

    host: str
    port: int = _PORT
    tls: bool = False
    ca_file: Path | None = None
    certificate_file: Path | None = None
    key_file: Path | None = None
    insecure: bool = False
    patience_s: float = 30.0

    def __post_init__(self) -> None:
        """Raises UsageError where it is not to be used."""
        files = [getattr(self, name) for name in _FILES]
        if self.tls and None in files:
            raise UsageError(f"{self.address} needs {', '.join(_FILES)}: tls://host:8786?ca_file=…&certificate_file=…&key_file=…")
        if not self.tls and any(files):
            raise UsageError(f"{self.address} is not encrypted, so certificates do nothing; write tls://")
        if not self.tls and not self.insecure and not _loopback(self.host):
            raise UsageError(
                f"{self.address} is neither encrypted nor this machine, and who connects there may run anything; "
                "use tls:// with certificates, or say insecure=yes where the network is yours alone"
            )
        for file in files:
            if file is not None and not file.is_file():
                raise UsageError(f"{self.address}: there is no file {file}")

    @property
    def address(self) -> str:
        """As Dask writes it."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'tls' if self.tls else 'tcp'}://{host}:{self.port}"

    @classmethod
    def from_text(cls, text: str) -> "DaskCluster":
        """Read `tcp://host[:port][?insecure=yes]` or `tls://host[:port]?ca_file=…&certificate_file=…&key_file=…`."""
        wanted = "tcp://host:8786 or tls://host:8786?ca_file=…&certificate_file=…&key_file=…"
        shown = shown_address(text, {*_FILES, "insecure"})
        try:
            parts = urlsplit(text)
            port = parts.port or _PORT
            options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
        except ValueError:
            raise UsageError(f"Dask address {shown!r}: host, port or options cannot be read; write {wanted}") from None
        tls = parts.scheme == "tls"
        if parts.scheme not in {"tcp", "tls"} or not parts.hostname or "@" in parts.netloc or parts.path.strip("/"):
            raise UsageError(f"Dask address {shown!r} is not {wanted}")
        if (unknown := options.keys() - {*_FILES, "insecure"}) or options.get("insecure", "yes") != "yes":
            raise UsageError(
                f"Dask address {shown!r}: {next(iter(unknown), 'insecure')} is not of {', '.join(_FILES)}, insecure=yes"
            )
        ca_file, certificate_file, key_file = (Path(options[name]) if name in options else None for name in _FILES)
        return cls(parts.hostname, port, tls, ca_file, certificate_file, key_file, "insecure" in options)


@contextmanager
def connected(
    cluster: DaskCluster, packages: tuple[str, ...]
) -> Iterator[Callable[[Callable[[str], str], Sequence[str]], Iterable[str]]]:
    """Connect to the workers. Raises UsageError where Dask is not installed, SpreadError where none answers."""
    try:
        import distributed  # noqa: PLC0415 — an extra, and it takes a second
    except ModuleNotFoundError as error:
        raise UsageError(f"{error.name} is not installed, which reaches a Dask cluster: pip install 'cnctwin[cluster]'") from None
    for logger in ("distributed", "distributed.client"):  # they say in many lines what we say in one
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    security = None
    if cluster.tls:
        security = distributed.Security(
            tls_ca_file=str(cluster.ca_file),
            tls_client_cert=str(cluster.certificate_file),
            tls_client_key=str(cluster.key_file),
            require_encryption=True,
        )
    try:
        client = distributed.Client(
            cluster.address, timeout=cluster.patience_s, security=security, set_as_default=False, name="cnctwin"
        )
    except Exception as error:  # also what something else that answers there makes of it
        said = " ".join(str(error.__cause__ or error).split()).rpartition(">: ")[2]
        raise SpreadError(f"no Dask scheduler answers at {cluster.address}: {said}; start one with `dask scheduler`") from None

    def spread(function: Callable[[str], str], texts: Sequence[str]) -> Iterator[str]:
        name = name_of(function, packages)
        futures = client.map(run_piece, [name] * len(texts), list(texts), pure=False, key="cnctwin-piece")
        try:
            for number, future in enumerate(futures, start=1):
                yield opened(_awaited(client, cluster, future, f"piece {number} of {len(futures)}"), number)
        finally:
            for future in futures:
                future.release()

    try:
        yield spread
    finally:
        client.close(timeout=5)


def _awaited(client: Any, cluster: DaskCluster, future: Any, piece: str) -> str:
    """Return the future's result. Raises SpreadError where it will hold nothing."""
    alone_since: float | None = None
    while True:
        try:
            return str(future.result(timeout=LOOK_S))
        except TimeoutError:
            trouble = _trouble(client)
        except Exception as error:
            raise SpreadError(f"{piece} is lost: {_said(error, cluster)}") from None
        alone_since = None if trouble is None else alone_since or time.monotonic()
        if alone_since is not None and time.monotonic() - alone_since > cluster.patience_s:
            raise SpreadError(f"{piece} is lost: {cluster.address} {trouble} for {cluster.patience_s:.0f} s")


def _trouble(client: Any) -> str | None:
    """Why no answer can be hoped for; None where a worker is there."""
    try:
        known = client.sync(client.scheduler.identity, callback_timeout=LOOK_S * 5)
    except (OSError, TimeoutError, AttributeError):
        return "has not answered"
    return None if known["workers"] else "has had no worker (start one with `dask worker`)"


def _said(error: Exception, cluster: DaskCluster) -> str:
    kind = type(error).__name__
    if kind == "FutureCancelledError":
        return f"the scheduler {cluster.address} has ended, or the way to it"
    if kind == "KilledWorker":
        return "each of the workers that took it was killed; is their memory enough?"
    if isinstance(error, ModuleNotFoundError):
        return f"the worker has no {error.name}; install the same cnctwin there as here"
    return f"{kind}: {' '.join(str(error).split())}"


def _loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
