"""The requests of clients, checked before anything is done with them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StrictInt
from pydantic.alias_generators import to_camel

IDS_MAX = 1_000
DEPTH_MAX = 100
ElementId = Annotated[str, Field(max_length=2_000)]
ElementIds = Annotated[list[ElementId], Field(max_length=IDS_MAX, examples=[["plant"]])]
ClientId = Annotated[str, Field(min_length=1, max_length=500, examples=["line-3-dashboard-8d1f6c"])]
SubscriptionId = Annotated[str, Field(max_length=200)]
SubscriptionIds = Annotated[list[SubscriptionId], Field(max_length=IDS_MAX)]
MaxDepth = Annotated[int, Field(ge=0, le=DEPTH_MAX, description="1: the object's own value; 0: with all that it is composed of")]


class Sent(BaseModel):
    """The root of all requests: keys that a later version may add are passed over."""

    model_config = ConfigDict(extra="ignore", alias_generator=to_camel, hide_input_in_errors=True)


class Types(Sent):
    """Object types or relationship types, by id."""

    element_ids: ElementIds


class Objects(Sent):
    """Objects, by id."""

    element_ids: ElementIds
    include_metadata: bool = False


class Related(Objects):
    """Objects whose relationships are asked for."""

    relationship_type: str | None = None


class Values(Sent):
    """Objects whose present values are asked for."""

    element_ids: ElementIds
    max_depth: MaxDepth = 1


class History(Sent):
    """Objects whose past is asked for, between two times in UTC."""

    element_ids: ElementIds = Field(default_factory=list)
    start_time: str = Field(max_length=60, examples=["2026-01-29T15:00:00Z"])
    end_time: str = Field(max_length=60, examples=["2026-01-29T16:00:00Z"])
    max_depth: MaxDepth = 1


class NewSubscription(Sent):
    """A subscription to be made."""

    client_id: ClientId
    display_name: Annotated[str | None, Field(max_length=200)] = None


class SomeSubscriptions(Sent):
    """Subscriptions of a client, by id."""

    client_id: ClientId
    subscription_ids: SubscriptionIds


class OneSubscription(Sent):
    """One subscription of a client."""

    client_id: ClientId
    subscription_id: SubscriptionId


class Registered(OneSubscription):
    """Objects that a subscription is to monitor."""

    element_ids: ElementIds
    max_depth: MaxDepth = 1


class Unregistered(OneSubscription):
    """Objects that a subscription is to monitor no longer."""

    element_ids: ElementIds


class Sync(OneSubscription):
    """A poll: the number up to which the client has everything, -1 for all."""

    last_sequence_number: StrictInt | None = None
