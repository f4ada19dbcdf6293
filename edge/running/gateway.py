"""Many machines in one process: the edge of each configuration file, watched and taken up again.

    folder ──each second──► files ──► running edges: begun, ended, or begun again with what the file says now

An edge that hangs, floods or crashes has its own connection, queue, store and session on the broker, so the others go on. One
that ends by itself is begun again, later each time; a file that cannot be used changes nothing for the edge that runs. What two
files must not share (node, machine, session and store files) is checked before either runs.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from edge.config import EdgeConfig
from edge.config_file import load
from edge.errors import ConfigError, EdgeError
from edge.running.runtime import EdgeRuntime

EDGES_MAX = 500
LOOK_S = 1.0
RESTART_S_MIN, RESTART_S_MAX = 1.0, 60.0
STABLE_S = 120.0
END_S_MAX = 15.0
_log = logging.getLogger(__name__)
Signature = tuple[int, int]


@dataclass(slots=True)
class _Edge:
    """One running edge; `due_s`: when it is begun again after it has ended by itself."""

    config: EdgeConfig[Any]
    runtime: EdgeRuntime | None = None
    thread: threading.Thread | None = None
    error: BaseException | None = None
    began_s: float = 0.0
    due_s: float = 0.0
    pause_s: float = RESTART_S_MIN
    restarts: int = 0
    is_to_end: bool = False

    @property
    def runs(self) -> bool:
        return self.thread is not None and self.thread.is_alive()


@dataclass(slots=True)
class _Seen:
    """The files as they were looked at last: what they were, and what was said of them."""

    signatures: dict[Path, Signature] = field(default_factory=dict)
    complaints: dict[Path, str] = field(default_factory=dict)


class Gateway:
    """Runs what `path` describes: a file, or all `*.toml` of a folder. `begin` makes the runtime of one configuration.

    A file alone that cannot be used, or whose control cannot serve it, ends `run` with its ConfigError; in a folder it is said,
    and the others run. look_s: between looks at the files; end_s_max: how long an edge may take to end
    """

    def __init__(
        self,
        path: Path,
        begin: Callable[[EdgeConfig[Any], int], EdgeRuntime],
        *,
        clock: Callable[[], float] = time.monotonic,
        look_s: float = LOOK_S,
        end_s_max: float = END_S_MAX,
    ) -> None:
        self._path, self._begin, self._clock, self._look_s, self._end_s_max = path, begin, clock, look_s, end_s_max
        self._is_single = not path.is_dir()  # once: a folder that is away for a moment has not become a file
        self._edges: dict[Path, _Edge] = {}
        self._seen = _Seen()

    def run(self, stop: threading.Event) -> dict[str, int]:
        """Run until stopped; the ledgers of all, added up."""
        try:
            self.look()
            if not self._edges:
                raise ConfigError(
                    next(iter(self._seen.complaints.values()), f"{self._path}: holds no *.toml; put one there for each machine")
                )
            while not stop.wait(self._look_s):
                self.look()
        finally:
            ledger = self._end_all()
        return ledger

    @property
    def runtimes(self) -> Mapping[str, EdgeRuntime]:
        """Return what runs now, by machine."""
        return {e.config.machine.name: e.runtime for e in self._edges.values() if e.runtime is not None and e.runs}

    def look(self) -> None:
        """Take up what has changed in the files, and begin again what has ended."""
        files = self._files()
        for file in [file for file in self._edges if file not in files]:
            _log.warning("%s: is gone; its edge ends", file)
            self._end(file)
        for file in [file for file in self._seen.signatures if file not in files]:  # one that comes back is new, whatever its age
            del self._seen.signatures[file]
            self._seen.complaints.pop(file, None)
        for file, signature in files.items():
            if self._seen.signatures.get(file) != signature:
                self._seen.signatures[file] = signature
                self._take_up(file)
        for file, edge in list(self._edges.items()):
            self._watch(file, edge)

    def _files(self) -> dict[Path, Signature]:
        single = self._is_single
        if not single and not self._path.is_dir():
            self._complain(self._path, f"{self._path}: is away; the edges go on as they were")
            return {file: signature for file, signature in self._seen.signatures.items() if file in self._edges}
        if not single:
            self._seen.complaints.pop(self._path, None)
        found: dict[Path, Signature] = {}
        files = [self._path] if single else sorted(self._path.glob("*.toml"), key=lambda file: (file not in self._edges, file))
        if len(files) > EDGES_MAX:
            text = f"{self._path}: {len(files)} files; {EDGES_MAX} edges run in one process, start another one"
            self._complain(self._path / "*.toml", text)
        for file in files[:EDGES_MAX]:
            try:
                status = file.stat()
                found[file] = status.st_mtime_ns, status.st_size
            except OSError:
                if single and file not in self._edges:
                    load(file)  # which says what is wrong with it
        if single and self._path in self._edges:
            found.setdefault(self._path, self._seen.signatures[self._path])  # an editor is just replacing it
        return found

    def _take_up(self, file: Path) -> None:
        is_read = False
        try:
            config = load(file)
            is_read = True
            self._check_apart(file, config)
        except ConfigError as error:
            if self._is_single and file not in self._edges:
                raise
            if is_read:
                self._seen.signatures[file] = 0, 0  # the other file may change too: look again
            what = "; the edge goes on as it was" if file in self._edges else ""
            self._complain(file, f"{error}{what}")
            return
        self._seen.complaints.pop(file, None)
        before = self._edges.get(file)
        if before is not None and before.config == config:
            return
        if before is not None:
            _log.warning("%s: has changed; the edge of %s begins again", file, config.machine.name)
            self._end(file)
        self._edges[file] = _Edge(config)

    def _check_apart(self, file: Path, config: EdgeConfig[Any]) -> None:
        mine = _own_things(config)
        for other, edge in self._edges.items():
            shared = mine & _own_things(edge.config) if other != file else None
            if shared:
                what, name = min(shared)
                raise ConfigError(f"{file}: {what} {name!r} is that of {other} too; give each machine its own")

    def _watch(self, file: Path, edge: _Edge) -> None:
        now_s = self._clock()
        if edge.runs:
            return
        if edge.thread is not None and edge.due_s == 0.0:
            edge.thread.join()
            self._ended(file, edge, now_s)
        if now_s >= edge.due_s:
            self._start(edge, now_s)

    def _ended(self, file: Path, edge: _Edge, now_s: float) -> None:
        """Begin an edge again that has ended by itself, at once if it was well for long."""
        if self._is_single and isinstance(edge.error, EdgeError):
            raise edge.error
        edge.pause_s = RESTART_S_MIN if now_s - edge.began_s > STABLE_S else min(2 * edge.pause_s, RESTART_S_MAX)
        edge.due_s = now_s + edge.pause_s
        self._complain(file, f"{file}: the edge of {edge.config.machine.name} has ended: {edge.error!r}; it is begun again")

    def _start(self, edge: _Edge, now_s: float) -> None:
        again = edge.thread is not None
        edge.restarts += again
        edge.began_s, edge.due_s, edge.error, edge.runtime = now_s, 0.0, None, None

        def run() -> None:
            try:
                edge.runtime = self._begin(edge.config, edge.restarts)
                if edge.is_to_end:  # told so while it was being made, when there was nothing yet to tell
                    edge.runtime.stop.set()
                edge.runtime.run()
            except BaseException as error:  # whatever it is, it ends this edge only
                edge.error = error
                if not isinstance(error, EdgeError):
                    _log.exception("the edge of %s", edge.config.machine.name)

        edge.thread = threading.Thread(target=run, name=f"edge {edge.config.machine.name}", daemon=True)
        edge.thread.start()

    def _end(self, file: Path, until_s: float | None = None) -> None:
        """until_s: by the monotonic clock; None: as long as an edge may take."""
        edge = self._edges.pop(file)
        self._tell_to_end(edge)
        if edge.thread is not None:
            edge.thread.join(self._end_s_max if until_s is None else max(until_s - time.monotonic(), 0.0))
            if edge.thread.is_alive():
                _log.warning("%s: the edge of %s does not end; it is left behind", file, edge.config.machine.name)

    def _end_all(self) -> dict[str, int]:
        """All at once; the sums of their ledgers."""
        until_s = time.monotonic() + self._end_s_max
        for edge in self._edges.values():
            self._tell_to_end(edge)
        ledger: dict[str, int] = {}
        runtimes = [edge.runtime for edge in self._edges.values() if edge.runtime is not None]
        for file in list(self._edges):
            self._end(file, until_s)
        for runtime in runtimes:
            for name, number in runtime.ledger.snapshot().items():
                ledger[name] = ledger.get(name, 0) + number
        return ledger

    @staticmethod
    def _tell_to_end(edge: _Edge) -> None:
        edge.is_to_end = True
        if edge.runtime is not None:
            edge.runtime.stop.set()

    def _complain(self, file: Path, text: str) -> None:
        if self._seen.complaints.get(file) != text:
            _log.warning("%s", text)
        self._seen.complaints[file] = text


def _own_things(config: EdgeConfig[Any]) -> set[tuple[str, str]]:
    """Return what no other edge of this process may have."""
    things = {
        ("node", f"{config.broker.group}/{config.node}"),
        ("machine", f"{config.broker.group}/{config.machine.name.casefold()}"),
        ("session_file", config.broker.session_file),
        ("store.file", config.store.file),
    }
    return {(what, name) for what, name in things if name}
