"""The LSV2 server on TCP: a thread for each client, and faults that tests can switch on.

Bound to 127.0.0.1. `stop` and `start` may follow each other; the control goes on meanwhile and the port stays the same.
"""

import random
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from typing import Self

from cnctwin.standins.lsv2_server.answers import Answers, Model, Session, error
from cnctwin.standins.lsv2_server.oscilloscope import ServoTrace
from cnctwin.standins.lsv2_server.telegram import Telegram, TelegramError, TelegramReader, encode
from cnctwin.standins.simulated_control.control import SimulatedControl

CLIENTS_MAX = 16
_GARBAGE_SEED = 19000


class Fault(StrEnum):
    """A fault with each telegram while it is switched on."""

    NONE = "none"
    HANG = "hang"  # it does not answer
    SLOW = "slow"  # it answers after `fault_s`
    REFUSE = "refuse"  # it closes each connection at once
    DROP = "drop"  # it closes the connection in the middle of an answer
    GARBAGE = "garbage"  # random bytes in place of an answer
    LENGTH = "length"  # an answer that announces two gigabytes
    SHORT = "short"  # a well-formed answer with the half of its payload
    OTHER = "other"  # the answer to another question
    ERROR = "error"  # T_ER with `error_code`
    PARTIAL = "partial"  # whole, but byte by byte


class Lsv2Server:
    """A simulated control behind LSV2. `pause` waits for hang and slow, so that a test can count that time for the machine."""

    def __init__(
        self,
        control: SimulatedControl,
        *,
        model: Model = Model.TNC640,
        port: int = 0,
        has_dnc: bool = True,
        plc_password: str | None = None,
        trace: ServoTrace | None = None,
        scope_password: str = "",
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self.answers = Answers(
            control, model, has_dnc=has_dnc, plc_password=plc_password, trace=trace, scope_password=scope_password
        )
        self.control = control
        self.fault = Fault.NONE
        self.fault_s = 1.0
        self.error_code = 99
        self.port = port
        self._pause = pause
        self._chance = random.Random(_GARBAGE_SEED)  # noqa: S311  garbage, not a secret
        self._lock = threading.Lock()
        self._listener: socket.socket | None = None
        self._clients: dict[socket.socket, threading.Thread] = {}
        self._acceptor: threading.Thread | None = None
        self._stopped = threading.Event()

    @property
    def url(self) -> str:
        """The address, as a configuration names it."""
        return f"lsv2://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Listen. OSError where the port is taken."""
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(("127.0.0.1", self.port))
            listener.listen(CLIENTS_MAX)
        except OSError:
            listener.close()
            raise
        self.port = listener.getsockname()[1]
        self._stopped = threading.Event()
        self._listener = listener
        self._acceptor = threading.Thread(target=self._accept, args=(listener, self._stopped), name="lsv2-accept", daemon=True)
        self._acceptor.start()

    def stop(self) -> None:
        """Close everything, as a control that is switched off."""
        self._stopped.set()
        if self._listener is not None:
            with suppress(OSError):
                self._listener.shutdown(socket.SHUT_RDWR)
            self._listener.close()
            self._listener = None
        self.drop_clients()
        if self._acceptor is not None:
            self._acceptor.join(5)
        self.drop_clients()

    def drop_clients(self) -> None:
        """Close the connections that are open now, and wait for their threads."""
        with self._lock:
            clients = list(self._clients.items())
        for client, _ in clients:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        for _, thread in clients:
            thread.join(5)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _accept(self, listener: socket.socket, stopped: threading.Event) -> None:
        while not stopped.is_set():
            try:
                client, _ = listener.accept()
            except OSError:
                return
            with self._lock:
                is_full = len(self._clients) >= CLIENTS_MAX
                if not is_full and not stopped.is_set() and self.fault is not Fault.REFUSE:
                    thread = threading.Thread(target=self._serve, args=(client, stopped), name="lsv2-client", daemon=True)
                    self._clients[client] = thread
                    thread.start()
                    continue
            client.close()

    def _serve(self, client: socket.socket, stopped: threading.Event) -> None:
        session, reader = Session(), TelegramReader()
        try:
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while not stopped.is_set():
                data = client.recv(65536)
                if not data:
                    return
                for telegram in reader.feed(data):
                    if not self._answer(client, session, telegram, stopped):
                        return
        except (OSError, TelegramError):
            return
        finally:
            client.close()
            with self._lock:
                self._clients.pop(client, None)

    def _answer(self, client: socket.socket, session: Session, telegram: Telegram, stopped: threading.Event) -> bool:
        """Answer; return True if the connection stays open."""
        fault = self.fault
        if fault is Fault.HANG:
            self._pause(self.fault_s)
            return not stopped.is_set()
        if fault is Fault.SLOW:
            self._pause(self.fault_s)
        answer = self.answers.answer(session, telegram)
        while (early_s := session.due_s - self.control.machine_s()) > 0 and not stopped.is_set():
            self._pause(min(early_s, 0.5))
        if fault is Fault.DROP:
            client.sendall(answer[: max(1, len(answer) // 2)])
            return False
        if fault is Fault.PARTIAL:
            for number in range(len(answer)):
                client.sendall(answer[number : number + 1])
            return True
        client.sendall(self._spoiled(fault, answer))
        return True

    def _spoiled(self, fault: Fault, answer: bytes) -> bytes:
        if fault is Fault.GARBAGE:
            return self._chance.randbytes(self._chance.randint(1, 64))
        if fault is Fault.LENGTH:
            return b"\x80\x00\x00\x00" + answer[4:]
        if fault is Fault.SHORT:
            payload = answer[8:]
            return encode(answer[4:8].decode("ascii"), payload[: len(payload) // 2])
        if fault is Fault.OTHER:
            return encode("S_MC", b"another answer\x00")
        if fault is Fault.ERROR:
            return error(self.error_code)
        return answer
