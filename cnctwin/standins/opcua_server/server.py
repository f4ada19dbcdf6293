"""A real OPC UA server that shows a simulated control: a thread with a loop of its own, on loopback.

Each change is written with the control's own time as its source time stamp. Faults can be set while it runs: a status in place of
a value, a value of another type, values that say that a queue ran over, a slow server, a state that is not Running. What a client
must not do is counted.
"""

import asyncio
import gc
import threading
import time
from collections.abc import Callable, Collection, Coroutine, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from asyncua import ua
from asyncua.common.callback import CallbackType
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.server import Server
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds
from asyncua.ua.status_codes import StatusCodes

from cnctwin.errors import ApplicationError
from cnctwin.processes.port import free_port
from cnctwin.standins.opcua_server.address_space import build, variant
from cnctwin.standins.opcua_server.alarms import Alarms, ShownAlarm
from cnctwin.standins.opcua_server.shown import MODELS, SINUMERIK, SINUMERIK_OBJECT, Shown, Value, shown
from cnctwin.standins.simulated_control.control import SimulatedControl
from edge.controls.opcua.certificates import fingerprint, own_identity

T = TypeVar("T")
LOOK_S = 0.02
START_S_MAX = 60.0
CONNECTIONS_MAX = 20
_SECURE = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]


class _Users:
    """The users who may come in: those with a password or a certificate; whoever comes without a name, where that is allowed."""

    def __init__(self, passwords: Mapping[str, str], certificates: Collection[bytes], anonymous: bool) -> None:
        self._passwords, self._certificates, self._anonymous = dict(passwords), set(certificates), anonymous

    def get_user(self, _server: Any, username: str | None = None, password: Any = None, certificate: Any = None) -> User | None:
        """The user of this name and password, or this certificate."""
        text = password.decode() if isinstance(password, bytes) else password
        if username is not None:
            is_known = self._passwords.get(username) == text
        else:  # of those without a name the library shows the application's certificate, where no user's came
            is_known = self._anonymous or certificate in self._certificates
        return User(role=UserRole.User, name=username or "anonymous") if is_known else None


class OpcUaServer:
    """Start it, use it, stop it; or `with`.

    folder: where its certificate is kept; secure: whether it offers security, with `open_too` beside an endpoint without
    users: passwords by name; user_certificates: of users, DER; anonymous: whether it lets those in who show neither
    missing: names of variables (last part of the path) that it does not have
    stepped: it looks at the control only when `look` is called, for tests that drive the machine's time
    """

    def __init__(
        self,
        control: SimulatedControl,
        folder: Path,
        *,
        port: int = 0,
        secure: bool = True,
        open_too: bool = False,
        users: Mapping[str, str] | None = None,
        user_certificates: Collection[bytes] = (),
        anonymous: bool = True,
        models: Collection[str] = tuple(MODELS),
        missing: Collection[str] = (),
        stepped: bool = False,
        valid_days: int = 3650,
    ) -> None:
        self.control = control
        self.port = port or free_port()
        self.url = f"opc.tcp://127.0.0.1:{self.port}"
        self.writes = self.calls = 0
        self.slow_s = 0.0
        self._identity = own_identity(folder, name="simulated-control", valid_days=valid_days, is_server=True)
        self._secure, self._open_too = secure, open_too or not secure
        self._users = _Users(users or {}, user_certificates, anonymous)
        wanted = {MODELS[name] for name in models}
        self._shown = tuple(one for one in shown() if one.model in wanted and one.path[-1] not in missing)
        self._stepped = stepped
        self._alarms: Alarms | None = None
        self._more_alarms: tuple[ShownAlarm, ...] = ()
        self._nodes: dict[Shown, ua.NodeId] = {}
        self._last: dict[Shown, Value] = {}
        self._statuses: dict[str, int] = {}
        self._server: Server | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._ready, self._stop = threading.Event(), threading.Event()
        self.error: BaseException | None = None

    @property
    def fingerprint(self) -> str:
        """SHA-256 of its certificate."""
        return fingerprint(self._identity.certificate.read_bytes())

    def __enter__(self) -> "OpcUaServer":
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.stop()

    def start(self) -> None:
        """Serve; ApplicationError where it cannot."""
        self._ready.clear()
        self._stop.clear()
        self.error = None
        self._thread = threading.Thread(target=self._work, name="opcua-server", daemon=True)
        self._thread.start()
        if not self._ready.wait(START_S_MAX) or self.error is not None:
            why = self.error or "it took too long"
            raise ApplicationError(f"port {self.port}: no OPC UA server can be started: {why}; give another with --port")

    def stop(self) -> None:
        """End it; the control goes on."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=10.0)
            self._thread = None

    def _work(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self.error = error
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        server = Server(user_manager=self._users)  # type: ignore[arg-type]  # what it needs of one
        with _no_collection():
            await server.init()
        server.iserver.max_connections = CONNECTIONS_MAX
        server.set_endpoint(self.url)
        server.set_server_name("Simulated control")
        await server.set_application_uri(self._identity.uri)
        policies = [*(_SECURE if self._secure else []), *([ua.SecurityPolicyType.NoSecurity] if self._open_too else [])]
        server.set_security_policy(policies)
        server.set_identity_tokens([ua.AnonymousIdentityToken, ua.UserNameIdentityToken, ua.X509IdentityToken])
        if self._secure:
            await server.load_certificate(self._identity.certificate)
            await server.load_private_key(self._identity.key, format="pem")
        server.disable_clock()
        self._nodes = await build(server, self._shown, self._called)
        self._alarms = await self._conditions(server)
        server.subscribe_server_callback(CallbackType.PreWrite, self._written)
        self._last.clear()
        self._server, self._loop = server, asyncio.get_running_loop()
        await server.start()
        try:
            await self._look()
            self._ready.set()
            while not self._stop.is_set():
                if self.slow_s:
                    time.sleep(self.slow_s)  # the whole server is slow, not this task
                if not self._stepped:
                    await self._look()
                await asyncio.sleep(LOOK_S)
        finally:
            self._server = None
            await server.stop()

    async def _conditions(self, server: Server) -> Alarms:
        notifiers = [server.nodes.server]
        if any(one.model == SINUMERIK for one in self._shown):
            index = await server.get_namespace_index(SINUMERIK)
            notifiers.append(server.get_node(ua.NodeId(ua.String(SINUMERIK_OBJECT), ua.Int16(index))))
        alarms = Alarms(server, notifiers, lambda: _stamp(self.control))
        await alarms.prepare()
        return alarms

    def _written(self, event: Any, _service: Any) -> None:
        self.writes += 1 if event.is_external else 0

    async def _called(self, _parent: Any) -> list[Any]:
        self.calls += 1
        return []

    def look(self) -> None:
        """Show what the control shows now."""
        self._in_loop(self._look())

    def at_once(self, look: Callable[[], bool]) -> None:
        """Look again and again without a pause as long as `look` says so; it is asked before each look, in our thread."""

        async def on() -> None:
            while look():
                await self._look()

        self._in_loop(on())

    async def _look(self) -> None:
        state, now = self.control.now(), _stamp(self.control)
        for one, node in self._nodes.items():
            if _is_named(one, self._statuses):
                continue
            value = one.value(state)
            if self._last.get(one) != value:
                self._last[one] = value
                await self._write(node, ua.DataValue(variant(one, value), ua.StatusCode(), now, now))
        if self._alarms is not None:
            stopping = () if state.alarm is None else (ShownAlarm(str(state.alarm[0]), state.alarm[1], acknowledged=False),)
            await self._alarms.show((*stopping, *self._more_alarms))
        server = self._server
        assert server is not None
        await self._write(
            ua.NodeId(ua.Int32(ObjectIds.Server_ServerStatus_CurrentTime)),
            ua.DataValue(ua.Variant(now), ua.StatusCode(), now, now),
        )

    async def _write(self, node: ua.NodeId, value: ua.DataValue) -> None:
        server = self._server
        assert server is not None
        await server.write_attribute_value(node, value)

    def set_status(self, name: str, status: str) -> None:
        """A variable (by the last part of its path) has this status in place of a value, until `clear`."""
        code = int(getattr(StatusCodes, status))
        self._statuses[name] = code
        self._put(name, lambda one: ua.DataValue(ua.Variant(None), ua.StatusCode(ua.UInt32(code)), _stamp(self.control)))

    def set_value(self, name: str, value: Any, *, overflow: bool = False) -> None:
        """A variable has this value, of whatever type, until `clear`; with the mark that values before it were discarded."""
        self._statuses[name] = 0
        status = ua.StatusCode(ua.UInt32(0x0480 if overflow else 0))
        for one, node in self._nodes.items():
            if _is_named(one, (name,)):
                kind = ua.VariantType[one.kind]
                shown_as = ua.Variant(value, kind) if isinstance(value, int | float) else ua.Variant(value)
                if shown_as.VariantType is not kind:
                    self._in_loop(self._retype(node, shown_as.VariantType))
                self._in_loop(self._write(node, ua.DataValue(shown_as, status, _stamp(self.control))))

    async def _retype(self, node: ua.NodeId, kind: Any) -> None:
        """The library takes no value of another type than the variable's: so that is another now, and the old value is gone."""
        server = self._server
        assert server is not None
        new = ua.DataValue(ua.Variant(ua.NodeId(ua.Int32(kind.value)), ua.VariantType.NodeId))
        await server.write_attribute_value(node, new, AttributeIds.DataType)
        gone = ua.StatusCode(ua.UInt32(StatusCodes.BadConfigurationError))
        await server.write_attribute_value(node, ua.DataValue(ua.Variant(None), gone, _stamp(self.control)))

    def set_alarms(self, *alarms: ShownAlarm) -> None:
        """Show these alarms beside that of the control."""
        self._more_alarms = alarms
        self.look()

    def say(self, text: str) -> None:
        """Send a message to the operator, as an event."""
        assert self._alarms is not None
        self._in_loop(self._alarms.say(text))

    def require_refresh(self) -> None:
        """Tell clients to ask for the alarms once more."""
        assert self._alarms is not None
        self._in_loop(self._alarms.warn(ObjectIds.RefreshRequiredEventType))

    def lose_events(self) -> None:
        """Tell clients that the queue of their events ran over."""
        assert self._alarms is not None
        self._in_loop(self._alarms.warn(ObjectIds.EventQueueOverflowEventType))

    def set_state(self, state: str) -> None:
        """The server's own state, as Running or CommunicationFault."""
        value = ua.Variant(ua.ServerState[state].value, ua.VariantType.Int32)
        node = ua.NodeId(ua.Int32(ObjectIds.Server_ServerStatus_State))
        self._in_loop(self._write(node, ua.DataValue(value)))

    def clear(self) -> None:
        """All variables as the control shows them, and no alarm but its own."""
        self._more_alarms = ()
        names = set(self._statuses)
        self._statuses.clear()
        for one in list(self._last):
            if _is_named(one, names):
                self._in_loop(self._retype(self._nodes[one], ua.VariantType[one.kind]))
                del self._last[one]
        self.look()

    def _put(self, name: str, value: Callable[[Shown], ua.DataValue]) -> None:
        for one, node in self._nodes.items():
            if _is_named(one, (name,)):
                self._in_loop(self._write(node, value(one)))

    def _in_loop(self, work: Coroutine[Any, Any, T]) -> T:
        assert self._loop is not None
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout=30.0)


def _stamp(control: SimulatedControl) -> Any:
    """The control's calendar as the library wants it: UTC without saying so."""
    return datetime.fromtimestamp(control.calendar_s(), UTC).replace(tzinfo=None)


@contextmanager
def _no_collection() -> Iterator[None]:
    """Make the standard's address space: many objects, none of them garbage; to look for it takes a third longer."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _is_named(one: Shown, names: Collection[str]) -> bool:
    return one.path[-1] in names or one.identifier in names
