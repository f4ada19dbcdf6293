"""asyncua, the OPC UA library (LGPL-3.0, used unchanged): an extra, that only a connection needs.

What the adapter may send is decided here, below everything else: a guard refuses each request that is not on the list before it
is encoded. No service that writes or changes the address space is on it, and a call passes for one method alone:
ConditionRefresh, which has the server repeat its alarms to us and changes nothing (OPC 10000-9, 5.5.7).
"""

import contextlib
import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from edge.errors import ConfigError, EdgeError

INSTALL = "the adapter opcua needs the library asyncua; install it with: pip install 'cnctwin[opcua]'"
ALLOWED = frozenset(
    {
        "GetEndpointsRequest",
        "CreateSessionRequest",
        "ActivateSessionRequest",
        "CloseSessionRequest",
        "BrowseRequest",
        "BrowseNextRequest",
        "TranslateBrowsePathsToNodeIdsRequest",
        "ReadRequest",
        "CreateSubscriptionRequest",
        "CreateMonitoredItemsRequest",
        "DeleteSubscriptionsRequest",
        "PublishRequest",
    }
)
CONDITION_TYPE, CONDITION_REFRESH = 2782, 3875  # nodes of the standard's own namespace


class ForbiddenServiceError(EdgeError):
    """A request that reading does not need; a bug of ours, caught before it left the house."""


def require() -> None:
    """ConfigError that says what to install where the library is missing."""
    if importlib.util.find_spec("asyncua") is None:
        raise ConfigError(INSTALL)


class ReadOnlyGuard:
    """Sees each request of a client before it is sent (asyncua's observer); lets those of the list through."""

    def observe_request(self, request: object) -> contextlib.AbstractContextManager[None]:
        """The context in which this request is sent."""
        name = type(request).__name__
        return self._passed(name, name in ALLOWED or (name == "CallRequest" and _is_refresh(request)))

    @contextmanager
    def _passed(self, name: str, is_allowed: bool) -> Iterator[None]:
        if not is_allowed:
            raise ForbiddenServiceError(f"{name} is not sent: this edge only reads")
        yield

    def on_request(self, request_type: str, duration: float, error: BaseException | None) -> None:
        """A request was answered."""

    def on_state_change(self, state: object) -> None:
        """The transport is in another state."""

    def on_subscription_event(self, subscription_id: int | None, event: object) -> None:
        """A subscription came or went."""

    def on_notification(self, subscription_id: int | None, event_count: int) -> None:
        """A notification came."""


def _is_refresh(request: Any) -> bool:
    """Return True if each of the methods to call is ConditionRefresh of ConditionType."""
    wanted = [(0, CONDITION_TYPE), (0, CONDITION_REFRESH)]
    methods = request.Parameters.MethodsToCall
    named = [[(int(node.NamespaceIndex), node.Identifier) for node in (one.ObjectId, one.MethodId)] for one in methods]
    return bool(named) and all(nodes == wanted for nodes in named)
