"""The server: a thread that accepts, one for each client, on loopback."""

import contextlib
import socket
import threading
from types import TracebackType
from typing import Self

from cnctwin.errors import ApplicationError
from cnctwin.standins.focas_server.faults import Faults, Refusal
from cnctwin.standins.focas_server.ledger import ServerLedger
from cnctwin.standins.focas_server.session import Session
from cnctwin.standins.focas_server.shown import ControlDescription, Moment
from cnctwin.standins.simulated_control.control import SimulatedControl

LOOPBACK = "127.0.0.1"
SESSIONS_MAX = 5
CONNECTIONS_MAX = 30
ACCEPT_S = 0.1
STOP_S = 2.0


class FocasServer:
    """Shows a simulated control over FOCAS Ethernet. It can be stopped and started again: same port, same control, same counts.

    sessions_max: a client beyond is told so (five on the 31i that somebody measured); connections_max: beyond, it is hung up on
    """

    def __init__(
        self,
        control: SimulatedControl,
        description: ControlDescription | None = None,
        *,
        port: int = 0,
        sessions_max: int = SESSIONS_MAX,
        connections_max: int = CONNECTIONS_MAX,
    ) -> None:
        self.faults = Faults()
        self.ledger = ServerLedger()
        self.port = port
        self._control = control
        self._description = description or ControlDescription()
        self._sessions_max, self._connections_max = sessions_max, connections_max
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._sessions: dict[threading.Thread, Session] = {}
        self._listener: socket.socket | None = None
        self._acceptor: threading.Thread | None = None

    @property
    def url(self) -> str:
        """The address at which `cnctwin edge discover` finds it."""
        return f"focas://{LOOPBACK}:{self.port}"

    @property
    def is_listening(self) -> bool:
        """True if it has been started and not stopped."""
        return self._listener is not None

    @property
    def clients(self) -> int:
        """The number of connections."""
        with self._lock:
            return len(self._sessions)

    def moment(self) -> Moment:
        """Return what the control shows now."""
        return Moment(self._control.now(), self._control.calendar_s(), self._description)

    def start(self) -> None:
        """Listen; at port 0 on any that is free, which then is its port."""
        try:
            self._listener = socket.create_server((LOOPBACK, self.port), backlog=self._connections_max)
        except OSError as error:
            raise ApplicationError(
                f"can't listen on {LOOPBACK} port {self.port}: {error.strerror}; give another port, or 0"
            ) from error
        self._listener.settimeout(ACCEPT_S)
        self.port = self._listener.getsockname()[1]
        self._stop = threading.Event()
        self._acceptor = threading.Thread(
            target=self._accept, args=(self._listener, self._stop), name="focas-server", daemon=True
        )
        self._acceptor.start()

    def stop(self) -> None:
        """Break off all connections and listen no more."""
        self._stop.set()
        if self._listener is not None and self._acceptor is not None:
            with contextlib.suppress(OSError):  # where the system does not wake a thread so, it looks itself
                self._listener.shutdown(socket.SHUT_RDWR)
            self._acceptor.join(STOP_S)
            self._listener.close()
        with self._lock:
            served = list(self._sessions.items())
        for thread, session in served:
            with contextlib.suppress(OSError):  # it has ended meanwhile
                session.connection.shutdown(socket.SHUT_RDWR)
            thread.join(STOP_S)
        self._acceptor = self._listener = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.stop()

    def _accept(self, listener: socket.socket, stop: threading.Event) -> None:
        while not stop.is_set():
            try:
                connection, _ = listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            self.ledger.count("connections")
            if self.faults.refusal is Refusal.CONNECTION or self.clients >= self._connections_max:
                self.ledger.count("connections refused")
                connection.close()
                continue
            self._serve(connection, stop)

    def _serve(self, connection: socket.socket, stop: threading.Event) -> None:
        session = Session(connection, self.moment, self.faults, self.ledger, stop, self._is_admitted)
        thread = threading.Thread(target=self._run, args=(session,), name="focas-client", daemon=True)
        with self._lock:
            self._sessions[thread] = session
        thread.start()

    def _run(self, session: Session) -> None:
        try:
            session.run()
        finally:
            with self._lock:
                self._sessions.pop(threading.current_thread(), None)

    def _is_admitted(self, session: Session) -> bool:
        """A lock is held while the place is counted and taken, so that two clients can't take the last one."""
        with self._lock:
            taken = sum(other.is_open for other in self._sessions.values())
            session.is_open = self.faults.refusal is not Refusal.SESSION and taken < self._sessions_max
            return session.is_open
