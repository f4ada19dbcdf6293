"""A session with an OPC UA server: which endpoint, whether it is trusted, who we are; then its state and its subscription.

Security is the best that the server offers, and never none unless the configuration says so. Every request passes the guard of
`edge.controls.opcua.library`.
"""

import asyncio
import logging
import os
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from asyncua import ua
from asyncua.client.client import Client
from asyncua.client.ua_client import UASocketProtocol
from asyncua.crypto import security_policies, uacrypto
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds
from asyncua.ua.uaerrors import UaError, UaStatusCodeError

from edge.controls.opcua.certificates import Identity, check_trust, fingerprint, folder_of, leaf_of, own_identity
from edge.controls.opcua.config import MODES, POLICIES, Config
from edge.controls.opcua.library import ReadOnlyGuard
from edge.controls.opcua.plain import stamp_ms, status_name
from edge.controls.opcua.point import UNIT
from edge.errors import ConfigError, ConnectionLostError
from edge.sweep import Fact

SESSION_S = 60.0
GOODBYE_S = 0.5
FAILURES = (UaError, OSError, TimeoutError, ValueError)  # what the library raises where the server is gone or answers wrongly
_STATUS = [
    ua.NodeId(ua.Int32(part))
    for part in (
        ObjectIds.Server_ServerStatus_StartTime,
        ObjectIds.Server_ServerStatus_CurrentTime,
        ObjectIds.Server_ServerStatus_State,
    )
]
_TRUST_US = {
    "BadCertificateUntrusted",
    "BadSecurityChecksFailed",
    "BadCertificateInvalid",
    "BadCertificateUseNotAllowed",
    "BadCertificateUriInvalid",
    "BadCertificateTimeInvalid",
}
_REFUSED = {"BadUserAccessDenied", "BadIdentityTokenRejected", "BadIdentityTokenInvalid", "BadUserSignatureInvalid"}


class Choice(NamedTuple):
    """An endpoint that was chosen."""

    policy: str
    mode: str
    certificate: bytes


class ServerStatus(NamedTuple):
    """The server's description of itself, and its clock; 0 and None where it gives no time."""

    started_ms: int
    current_ms: int | None
    state: str


def ranked(endpoints: Sequence[ua.EndpointDescription]) -> list[Choice]:
    """Return what a server offers that is worth taking, best first: encrypted before signed, then by policy."""
    offered = [(ep, str(ep.SecurityPolicyUri).rpartition("#")[2].replace("_", "")) for ep in endpoints]
    usable = [
        Choice(policy, ep.SecurityMode.name, leaf_of(bytes(ep.ServerCertificate or b"")))
        for ep, policy in offered
        if policy in POLICIES and ep.SecurityMode.name in MODES and str(ep.EndpointUrl).startswith("opc.tcp")
    ]
    return sorted(usable, key=lambda choice: (MODES.index(choice.mode), POLICIES.index(choice.policy)))


def choose(url: str, wanted: str, endpoints: Sequence[ua.EndpointDescription]) -> Choice | None:
    """The endpoint to take, None for no security; ConnectionLostError where the server does not offer what is wanted."""
    if wanted == "none":
        return None
    choices = ranked(endpoints)
    if wanted != "auto":
        choices = [choice for choice in choices if f"{choice.policy}:{choice.mode}" == wanted]
    if choices:
        return choices[0]
    offers = ", ".join(sorted({f"{str(ep.SecurityPolicyUri).rpartition('#')[2]}:{ep.SecurityMode.name}" for ep in endpoints}))
    way_out = 'switch on Basic256Sha256 or better at the server, or set opcua.security = "none" and accept that it can be read'
    what = "no security that is safe" if wanted == "auto" else f"no {wanted}"
    raise ConnectionLostError(f"{url}: the server offers {what} (it has {offers or 'nothing'}); {way_out} and altered on the way")


@asynccontextmanager
async def opened(config: Config) -> AsyncIterator[Client]:
    """A client with an active session; ConnectionLostError in one line where there is none to be had."""
    client = _client(config)
    try:
        try:
            identity = await _secure(config, client)
            await _set_user(config, client)
            await client.connect(auto_reconnect=False)
        except BaseException:
            await _hang_up(client, client.uaclient.protocol)
            raise
    except FAILURES as error:
        raise ConnectionLostError(one_line(config, error)) from error
    assert identity is None or identity.key.exists()
    try:
        yield client
    finally:
        await _goodbye(client)


def _client(config: Config) -> Client:
    source = config.source
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # a lost line is told in one line, by us
    client = Client(source.url, timeout=source.timeout_s, watchdog_intervall=max(source.timeout_s, 1.0))
    client.name = client.description = "cnctwin edge"
    client.product_uri = "urn:cnctwin:edge"
    client.session_timeout = round(max(SESSION_S, 4 * source.timeout_s) * 1000)
    client.max_messagesize = 16 * 1024 * 1024
    client.uaclient.observer = ReadOnlyGuard()  # type: ignore[assignment]  # the same methods; its class would import asyncua
    return client


async def _secure(config: Config, client: Client) -> Identity | None:
    source, folder = config.source, folder_of(config.source.certificate_folder)
    if source.security == "none":
        return None
    chosen = choose(source.url, source.security, await client.connect_and_get_server_endpoints())
    assert chosen is not None
    check_trust(source.url, chosen.certificate, source.server_fingerprint, folder)
    identity = await asyncio.to_thread(own_identity, folder)
    client.application_uri = identity.uri
    await client.set_security(
        getattr(security_policies, f"SecurityPolicy{chosen.policy}"),
        uacrypto.CertProperties(identity.certificate.read_bytes(), "der"),
        uacrypto.CertProperties(identity.key.read_bytes(), "pem"),
        server_certificate=uacrypto.CertProperties(chosen.certificate, "der"),
        mode=ua.MessageSecurityMode[chosen.mode],
    )
    return identity


async def _set_user(config: Config, client: Client) -> None:
    source = config.source
    if source.username:
        if source.password_env not in os.environ:
            raise ConfigError(
                f"{config.path}: opcua.password_env = {source.password_env!r}: no such environment variable; set it"
            )
        client.set_user(source.username)
        client.set_password(os.environ[source.password_env])
    if source.user_certificate:
        client.user_certificate = await uacrypto.load_certificate(*_file(config, "user_certificate", source.user_certificate))
        content, extension = _file(config, "user_key", source.user_key)
        client.user_private_key = await uacrypto.load_private_key(content, None, extension)


def _file(config: Config, key: str, name: str) -> tuple[bytes, str]:
    try:
        content = Path(name).read_bytes()
    except OSError as error:
        raise ConfigError(f"{config.path}: opcua.{key} = {name!r}: cannot be read: {error.strerror}") from error
    return content, "pem" if content.lstrip().startswith(b"-----BEGIN") else "der"


async def _goodbye(client: Client) -> None:
    """Close the session if the server still listens, and the socket in any case."""
    protocol = client.uaclient.protocol
    with suppress(Exception):
        await asyncio.wait_for(client.disconnect(), GOODBYE_S)
    await _hang_up(client, protocol)


async def _hang_up(client: Client, protocol: UASocketProtocol | None) -> None:
    """Give the socket back at once, whatever was still to be sent to a server that does not listen."""
    if protocol is not None and protocol.transport is not None:
        protocol.transport.abort()
    client.disconnect_socket()
    for _ in range(3):  # the transport tells its end in the next rounds of the loop
        await asyncio.sleep(0)


def one_line(config: Config, error: Exception) -> str:
    """Return what went wrong, where, and the way out."""
    url, folder = config.source.url, folder_of(config.source.certificate_folder)
    if isinstance(error, UaStatusCodeError):
        name = status_name(ua.StatusCode(ua.UInt32(error.code)))
        if name in _TRUST_US:
            return f"{url}: the server refuses our certificate ({name}); trust {folder}/own.der at the control"
        if name in _REFUSED:
            return f"{url}: the server refuses the user ({name}); check opcua.username, the password, and the user's rights"
        return f"{url}: the server answers {name}"
    if isinstance(error, TimeoutError):
        return f"{url}: no answer in time; is the server running, and opcua.timeout_s long enough?"
    if isinstance(error, ConnectionRefusedError | socket.gaierror):
        return f"{url}: {error.strerror or error}; is the server running, and the address right?"
    if isinstance(error, ConnectionError):
        return f"{url}: {str(error) or type(error).__name__}; does an OPC UA server answer there? its port is mostly 4840"
    return f"{url}: {str(error) or type(error).__name__}"


async def read_status(client: Client) -> ServerStatus:
    """The server's status: one read of the parts, since some servers do not keep the whole up to date."""
    values: list[Any] = [value.Value.Value if value.Value is not None else None for value in await read_values(client, _STATUS)]
    started, current, state = values
    names = {number.value: number.name for number in ua.ServerState}
    return ServerStatus(stamp_ms(started) or 0, stamp_ms(current), str(names.get(state, f"state {state}")))


async def read_values(client: Client, nodes: Sequence[ua.NodeId]) -> list[ua.DataValue]:
    """The values of these nodes with both time stamps: one read."""
    parameters = ua.ReadParameters()
    parameters.TimestampsToReturn = ua.TimestampsToReturn.Both
    parameters.NodesToRead = [ua.ReadValueId(NodeId=node, AttributeId=AttributeIds.Value) for node in nodes]
    values: list[ua.DataValue] = await client.uaclient.session.read(parameters)
    return values


class Watched(NamedTuple):
    """A subscription: its id, the keys by client handle, those that cannot be watched, and what the server made of our wishes."""

    subscription: int
    keys: dict[int, str]
    refused: dict[str, str]
    publishing_ms: float
    sampled_ms: float
    queue_size: int


async def watch(
    config: Config,
    client: Client,
    nodes: Sequence[tuple[str, ua.NodeId]],
    keep_alive_s: float,
    heard: Callable[[ua.PublishResult], None],
) -> Watched:
    """Subscribe to these nodes with queues of their own."""
    source = config.source
    wishes = ua.CreateSubscriptionParameters()
    wishes.RequestedPublishingInterval = float(source.publishing_ms)
    wishes.RequestedMaxKeepAliveCount = ua.UInt32(max(1, round(keep_alive_s * 1000 / source.publishing_ms)))
    wishes.RequestedLifetimeCount = ua.UInt32(max(30, 10 * wishes.RequestedMaxKeepAliveCount))
    wishes.MaxNotificationsPerPublish = ua.UInt32(4000)
    wishes.PublishingEnabled = True
    made = await client.uaclient.session.create_subscription(wishes, heard)
    keys, refused = dict[int, str](), dict[str, str]()
    sampled_ms, queue_size = 0.0, source.queue_size
    for begin in range(0, len(nodes), 200):
        some = nodes[begin : begin + 200]
        items = [_item(config, begin + number + 1, node) for number, (_, node) in enumerate(some)]
        request = ua.CreateMonitoredItemsParameters()
        request.SubscriptionId = made.SubscriptionId
        request.ItemsToCreate = items
        request.TimestampsToReturn = ua.TimestampsToReturn.Both
        keys |= {begin + number + 1: key for number, (key, _) in enumerate(some)}
        for number, result in enumerate(await client.uaclient.session.create_monitored_items(request)):
            if result.StatusCode.is_good():
                sampled_ms = max(sampled_ms, float(result.RevisedSamplingInterval))
                queue_size = max(queue_size, int(result.RevisedQueueSize))
            else:
                refused[keys.pop(begin + number + 1)] = status_name(result.StatusCode)
    return Watched(int(made.SubscriptionId), keys, refused, float(made.RevisedPublishingInterval), sampled_ms, queue_size)


def _item(config: Config, handle: int, node: ua.NodeId) -> ua.MonitoredItemCreateRequest:
    item = ua.MonitoredItemCreateRequest()
    item.ItemToMonitor = ua.ReadValueId(NodeId=node, AttributeId=AttributeIds.Value)
    item.MonitoringMode = ua.MonitoringMode.Reporting
    item.RequestedParameters = ua.MonitoringParameters(
        ClientHandle=ua.UInt32(handle),
        SamplingInterval=float(config.source.sampling_ms),
        QueueSize=ua.UInt32(config.source.queue_size),
        DiscardOldest=True,
    )
    return item


async def units_of(client: Client, nodes: dict[str, ua.NodeId]) -> dict[str, str]:
    """The engineering units that these variables declare, by key, as the server writes them."""
    element: Any = ua.RelativePathElement()
    element.ReferenceTypeId, element.IsInverse = ua.NodeId(ua.Int32(ObjectIds.HasProperty)), False
    element.TargetName = ua.QualifiedName("EngineeringUnits", ua.UInt16(0))
    path = ua.RelativePath(Elements=[element])
    session, found = client.uaclient.session, dict[str, str]()
    keys = list(nodes)[:500]
    if not keys:
        return {}
    asked = [ua.BrowsePath(StartingNode=nodes[key], RelativePath=path) for key in keys]
    for key, result in zip(keys, await session.translate_browsepaths_to_nodeids(asked), strict=True):
        if result.StatusCode.is_good() and result.Targets:
            target = result.Targets[0].TargetId
            value = (await read_values(client, [ua.NodeId(target.Identifier, target.NamespaceIndex)]))[0].Value
            name = getattr(getattr(value, "Value", None), "DisplayName", None)
            found[key] = str(getattr(name, "Text", "") or "")
    return found


async def unit_facts(config: Config, client: Client, nodes: Sequence[tuple[str, ua.NodeId]]) -> list[Fact]:
    """The units that the server states of what [variables] and [plc] chose, as facts."""
    chosen = {one.signal for one in config.chosen}
    units = await units_of(client, {key: node for key, node in nodes if key in chosen})
    return [Fact(UNIT + key, unit) for key, unit in units.items() if unit]


def fingerprint_of(client: Client) -> str:
    """The fingerprint of the certificate that this session rests on; "" where there is none."""
    peer = client.security_policy.peer_certificate
    return fingerprint(bytes(peer)) if peer and client.security_policy.Mode != ua.MessageSecurityMode.None_ else ""
