"""asyncua, the OPC UA library (LGPL-3.0, used unchanged): an extra, that only a connection needs.

What the adapter may send is decided here, below everything else: a guard refuses each request that is not on the list before it
is encoded. No service that writes, calls a method, or changes the address space is on it.
"""

import contextlib
import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager

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
        return self._allowed(type(request).__name__)

    @contextmanager
    def _allowed(self, name: str) -> Iterator[None]:
        if name not in ALLOWED:
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
