"""The subscribe methods. A subscription of another client, or of another user, is as one that was never created."""

from collections.abc import Iterable
from functools import partial

from fastapi import APIRouter, Request
from fastapi.responses import Response

from cnctwin.api.errors import ApiError
from cnctwin.api.i3x.answer import answer
from cnctwin.api.i3x.problem import Json, bulk, item, missing, success
from cnctwin.api.i3x.requests import NewSubscription, OneSubscription, Registered, SomeSubscriptions, Sync, Unregistered
from cnctwin.api.i3x.space import Space
from cnctwin.api.i3x.subscription import UPDATES_MAX, Owner, Subscription
from cnctwin.api.i3x.subscriptions import Subscriptions, presents
from cnctwin.api.live.event_stream import EventStream
from cnctwin.api.store_reader import StoreReader


def subscribe_routes(space: Space, store: StoreReader, held: Subscriptions) -> APIRouter:
    """The routes. What they do to subscriptions they do in the event loop, without a wait in between."""
    router = APIRouter(tags=["Subscribe"], prefix="/subscriptions")

    @router.post("")
    async def create(request: Request, asked: NewSubscription) -> Json:
        """Create a subscription."""
        made = held.create(_owner(request, asked.client_id), asked.display_name or "", request.state.client)
        return success({"clientId": asked.client_id, "subscriptionId": made.id, "displayName": made.display_name})

    @router.post("/list")
    async def subscriptions(request: Request, asked: SomeSubscriptions) -> Json:
        """Show subscriptions by id."""
        return bulk(
            missing("subscriptionId", name, "Subscription") if one is None else item("subscriptionId", name, one.as_json())
            for name, one in _some(held, request, asked)
        )

    @router.post("/delete")
    async def delete(request: Request, asked: SomeSubscriptions) -> Json:
        """Delete subscriptions by id."""
        entries = []
        for name, one in _some(held, request, asked):
            if one is None:
                entries.append(missing("subscriptionId", name, "Subscription"))
            else:
                held.delete(one)
                entries.append(item("subscriptionId", name, None))
        return bulk(entries)

    @router.post("/register")
    async def register(request: Request, asked: Registered) -> Json:
        """Monitor objects from now on; their present values are the first updates."""
        _known(held, request, asked)
        found = await store.work(lambda: presents(space, asked.element_ids, asked.max_depth))
        return _each(asked.element_ids, held.register(_known(held, request, asked), found, asked.max_depth))

    @router.post("/unregister")
    async def unregister(request: Request, asked: Unregistered) -> Json:
        """Monitor objects no longer."""
        return _each(asked.element_ids, held.unregister(_known(held, request, asked), asked.element_ids))

    @router.post("/sync")
    async def sync(request: Request, asked: Sync) -> Response:
        """Acknowledge what was received, and return what waits."""
        subscription = _known(held, request, asked)
        if subscription.stream is not None:
            raise ApiError(400, "this subscription has an open stream; close it before you call sync")
        held.used(subscription)
        subscription.acknowledge(asked.last_sequence_number)
        waiting = [
            {"sequenceNumber": batch.sequence, "updates": [update.as_json() for update in batch.updates]}
            for batch in subscription.pending()
        ]
        line = f"updates were dropped, the oldest first: a subscription holds at most {UPDATES_MAX}"
        return answer(request, success(waiting), line if subscription.has_lost else None, "Updates dropped")

    @router.post("/stream", response_class=Response, responses={200: {"content": {"text/event-stream": {}}}})
    async def stream(request: Request, asked: OneSubscription) -> Response:
        """Server-sent events, each a list of updates, at most ten a second for each machine."""
        subscription = _known(held, request, asked)
        opened = held.open(subscription)
        return EventStream(b"", opened.following, partial(held.close, subscription, opened))

    return router


def _owner(request: Request, client_id: str) -> Owner:
    return Owner(client_id, request.state.user)


def _known(held: Subscriptions, request: Request, asked: OneSubscription) -> Subscription:
    found = held.find(asked.subscription_id, _owner(request, asked.client_id))
    if found is None:
        raise ApiError(404, f"Subscription not found: {asked.subscription_id}")
    return found


def _some(held: Subscriptions, request: Request, asked: SomeSubscriptions) -> Iterable[tuple[str, Subscription | None]]:
    owner = _owner(request, asked.client_id)
    for name in asked.subscription_ids:
        yield name, held.find(name, owner)


def _each(element_ids: list[str], known: list[bool]) -> Json:
    return bulk(
        item("elementId", name, None) if is_known else missing("elementId", name, "Element")
        for name, is_known in zip(element_ids, known, strict=True)
    )
