"""i3X over a real server, read by CESMII's own client: streams, the limits, and what becomes of abandoned subscriptions."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx
import i3x
import pytest

from cnctwin.api.application import create_app
from cnctwin.api.errors import ApiError
from cnctwin.api.i3x import subscription as one_subscription
from cnctwin.api.i3x import subscriptions as all_subscriptions
from cnctwin.api.i3x.problem import PREFIX
from cnctwin.api.i3x.space import Space
from cnctwin.api.i3x.subscription import Owner, Update
from cnctwin.api.i3x.subscriptions import Subscriptions, presents
from cnctwin.api.i3x.vqt import Vqt
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from tests.cnctwin.api.small_plant import birth, data, death, now, small_plant
from tests.edge.host_watch import wait

RPM = "signal/vmc/spindle_rpm"
ME = Owner("me", None)


class Fed(Server):
    """A server whose plant is told by hand."""

    def __init__(self) -> None:
        self.live = small_plant()
        self.app = create_app(Sources(self.live))
        super().__init__(self.app)

    def tell(self, **values: Any) -> None:
        """A message of the machine, as the viewer's thread would take it."""
        t_ms = now()
        self.live.take([data(values, t_ms)], t_ms)
        self.app.state.tell(self.live.flush(t_ms))


@pytest.fixture(scope="module")
def server() -> Iterator[Fed]:
    with Fed() as server:
        yield server


@pytest.fixture
def client(server: Fed) -> Iterator[i3x.Client]:
    with i3x.Client(server.url + PREFIX) as client:
        yield client


def test_their_client_explores_and_reads(client: i3x.Client) -> None:
    assert client.get_info().capabilities["update"] == {"current": False, "history": False}
    assert [one.element_id for one in client.get_objects(root=True)] == ["plant"]
    (down,) = client.get_related_objects(["plant"], relationship_type="HasChildren")
    assert (down.object.element_id, down.object.is_composition) == ("machine/vmc", True)
    value = client.get_value("machine/vmc", max_depth=0)
    assert (value.value["exec_state"], value.quality) == ("ACTIVE", "Good")
    assert value.components is not None
    assert value.components["signal/vmc/twin/spindle_temp_c"].value == 31.5
    assert client.get_history(RPM, "2026-01-01T00:00:00Z", "2026-01-02T00:00:00Z").values[0].quality == "GoodNoData"
    with pytest.raises(i3x.NotFoundError):
        client.get_value("machine/nobody")
    with pytest.raises(i3x.I3XError):
        client.update_value(RPM, 1.0)


def test_their_client_syncs_and_acknowledges(server: Fed, client: i3x.Client) -> None:
    made = client.create_subscription("shift")
    client.register_items(made, [RPM])
    server.tell(spindle_rpm=1234.5)

    def values() -> list[Any]:
        return [update.value for batch in client.sync_subscription(made) for update in batch.updates]

    wait(lambda: values()[-1:] == [1234.5], "the update")
    last = client.sync_subscription(made)[-1].sequence_number
    assert client.sync_subscription(made, last) == []
    client.unsubscribe(made)
    with pytest.raises(i3x.NotFoundError):
        client.sync_subscription(made)


def test_their_client_is_streamed_what_waited_and_what_comes(server: Fed, client: i3x.Client) -> None:
    """SUB-09."""
    heard: list[tuple[str, Any]] = []
    client.on_value_change = lambda _, change: heard.append((change.element_id, change.value))
    held = client.subscribe(["machine/vmc"], max_depth=0)
    wait(lambda: (RPM, 6000.0) in heard or len(heard) >= 7, "the present values")
    server.tell(spindle_rpm=777.0, exec_state="FEED_HOLD")
    wait(lambda: (RPM, 777.0) in heard, "the new value")
    wait(lambda: heard[-1][0] == "machine/vmc" and heard[-1][1]["exec_state"] == "FEED_HOLD", "the machine's own value")
    with httpx.Client(base_url=server.url + PREFIX) as plain:
        sync = plain.post("/subscriptions/sync", json={"clientId": client.client_id, "subscriptionId": held.subscription_id})
        assert sync.status_code == 400
        assert "open stream" in sync.json()["responseDetail"]["detail"]
        # The server ends the stream; where the client does, it waits for its own thread for five seconds.
        plain.post("/subscriptions/delete", json={"clientId": client.client_id, "subscriptionIds": [held.subscription_id]})


def test_a_second_stream_ends_the_first_without_an_error(server: Fed) -> None:
    """SUB-14."""
    with httpx.Client(base_url=server.url + PREFIX, timeout=60.0) as client:
        made = client.post("/subscriptions", json={"clientId": "two"}).json()["result"]["subscriptionId"]
        asked = {"clientId": "two", "subscriptionId": made}
        ended: list[str] = []

        def read(answer: httpx.Response) -> None:
            ended.append("".join(answer.iter_text()))

        with client.stream("POST", "/subscriptions/stream", json=asked) as first:
            assert first.headers["content-type"].startswith("text/event-stream")
            reader = threading.Thread(target=read, args=(first,))
            reader.start()
            with client.stream("POST", "/subscriptions/stream", json=asked) as second:
                assert second.status_code == 200
                reader.join(30.0)
                assert len(ended) == 1
        client.post("/subscriptions/delete", json={"clientId": "two", "subscriptionIds": [made]})


def test_a_server_that_stops_ends_its_streams() -> None:
    with Fed() as server:
        made = httpx.post(f"{server.url}{PREFIX}/subscriptions", json={"clientId": "me"}).json()["result"]["subscriptionId"]
        asked = {"clientId": "me", "subscriptionId": made}
        with httpx.stream("POST", f"{server.url}{PREFIX}/subscriptions/stream", json=asked, timeout=60.0) as stream:
            began_s = time.monotonic()
            stopping = threading.Thread(target=server.stop)
            stopping.start()
            assert "data:" not in "".join(stream.iter_text())
        stopping.join()
        assert time.monotonic() - began_s < 30.0


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        """The time."""
        return self.now_s


def subscriptions(live: LivePlant | None = None) -> tuple[Subscriptions, Clock]:
    clock = Clock()
    return Subscriptions(Space(small_plant() if live is None else live), clock), clock


def told(held: Subscriptions, live: LivePlant, *events: Any) -> None:
    t_ms = now()
    live.take(list(events), t_ms)
    held.deliver(live.flush(t_ms))


def values_of(subscription: one_subscription.Subscription) -> list[tuple[str, Any, str]]:
    return [(one.element_id, one.vqt.value, one.vqt.quality) for batch in subscription.pending() for one in batch.updates]


def test_an_abandoned_subscription_is_deleted_and_watches_nothing_any_more() -> None:
    live = small_plant()
    held, clock = subscriptions(live)
    made = held.create(ME, "", "127.0.0.1")
    held.register(made, presents(held._space, ["machine/vmc", "plant"], 1), 1)
    clock.now_s = all_subscriptions.TTL_S - 1.0
    assert held.find(made.id, ME) is made
    held.used(made)
    clock.now_s += all_subscriptions.TTL_S + 1.0
    assert held.find(made.id, ME) is None
    assert len(held) == 0
    assert (live._waiting, live._fleet_readers) == ({}, 0)


def test_what_is_registered_twice_at_once_is_watched_until_it_is_unregistered_once() -> None:
    live = small_plant()
    held, _ = subscriptions(live)
    made = held.create(ME, "", "127.0.0.1")
    held.register(made, presents(held._space, [RPM, RPM, "machine/vmc"], 1), 1)
    assert [element for element, _, _ in values_of(made)] == [RPM, "machine/vmc"]
    assert set(live._waiting) == {"vmc"}
    assert held.unregister(made, [RPM, "machine/vmc", RPM]) == [True, True, False]
    assert (made.machines, live._waiting) == ({}, {})


def test_a_subscription_with_an_open_stream_is_not_abandoned() -> None:
    held, clock = subscriptions()
    made = held.create(ME, "", "127.0.0.1")
    stream = held.open(made)
    clock.now_s = 10 * all_subscriptions.TTL_S
    assert held.find(made.id, ME) is made
    held.close(made, stream)
    assert held.find(made.id, ME) is made


def test_a_subscription_belongs_to_the_user_who_made_it() -> None:
    held, _ = subscriptions()
    made = held.create(Owner("me", "ada"), "", "127.0.0.1")
    assert [held.find(made.id, Owner("me", user)) for user in ("grace", None)] == [None, None]
    assert held.find(made.id, Owner("me", "ada")) is made


def test_there_are_only_so_many_subscriptions_of_one_address_and_of_all() -> None:
    held, _ = subscriptions()
    for address in range(all_subscriptions.SUBSCRIPTIONS_MAX // all_subscriptions.OF_ONE_MAX):
        for _ in range(all_subscriptions.OF_ONE_MAX):
            held.create(ME, "", f"10.0.0.{address}")
        with pytest.raises(ApiError, match="limit"):
            held.create(ME, "", f"10.0.0.{address}")
    with pytest.raises(ApiError, match=f"{all_subscriptions.SUBSCRIPTIONS_MAX} subscriptions"):
        held.create(ME, "", "10.9.9.9")


def test_what_overflows_is_dropped_oldest_first_and_is_said_until_something_newer_is_acknowledged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(one_subscription, "UPDATES_MAX", 3)
    held, _ = subscriptions()
    made = held.create(ME, "", "127.0.0.1")
    dropped = [made.put([Update(RPM, Vqt(float(number), "Good", number))]) for number in range(5)]
    assert dropped == [0, 0, 0, 1, 1]
    assert [(batch.sequence, batch.updates[0].vqt.value) for batch in made.pending()] == [(3, 2.0), (4, 3.0), (5, 4.0)]
    assert made.has_lost
    made.acknowledge(4)
    assert not made.has_lost
    assert [batch.sequence for batch in made.pending()] == [5]


def test_only_what_is_monitored_is_told_and_a_machine_only_where_its_own_value_changes() -> None:
    live = small_plant()
    held, _ = subscriptions(live)
    signal, machine, whole = (held.create(Owner(name, None), "", "127.0.0.1") for name in ("signal", "machine", "whole"))
    held.register(signal, presents(held._space, [RPM], 1), 1)
    held.register(machine, presents(held._space, ["machine/vmc"], 1), 1)
    held.register(whole, presents(held._space, ["machine/vmc"], 0), 0)
    for one in (signal, machine, whole):
        one.acknowledge(one_subscription.CLEAR)
    told(held, live)  # the state of a machine that is watched from now on
    for one in (signal, machine, whole):
        one.acknowledge(one_subscription.CLEAR)
    told(held, live, data({"spindle_rpm": 5.0}, now()), data({"spindle_temp_c": 31.0}, now()))
    assert values_of(signal) == [(RPM, 5.0, "Good")]
    assert [element for element, _, _ in values_of(machine)] == ["machine/vmc"]
    assert [element for element, _, _ in values_of(whole)] == [RPM, "machine/vmc"]
    for one in (signal, machine, whole):
        one.acknowledge(one_subscription.CLEAR)
    told(held, live, data({"spindle_rpm": 5.0}, now()))
    assert [element for element, _, _ in values_of(whole)] == [RPM]
    assert values_of(machine) == []


def test_the_death_of_an_edge_makes_values_uncertain_and_a_new_machine_changes_the_plant() -> None:
    live = small_plant()
    held, _ = subscriptions(live)
    made = held.create(ME, "", "127.0.0.1")
    held.register(made, presents(held._space, ["plant", RPM], 1), 1)
    made.acknowledge(one_subscription.CLEAR)
    told(held, live, death({"spindle_rpm": 6000.0}, now()))
    assert (RPM, 6000.0, "Uncertain") in values_of(made)
    told(held, live, birth({"spindle_rpm": 1.0}, now(), machine="lathe"))
    assert ("plant", {"machines": ["lathe", "vmc"]}, "Good") in values_of(made)


def test_a_subscription_monitors_only_so_many_objects() -> None:
    held, _ = subscriptions()
    made = held.create(ME, "", "127.0.0.1")
    made.monitored = {str(number): one_subscription.Monitored("", 1) for number in range(one_subscription.MONITORED_MAX)}
    with pytest.raises(ApiError, match="at most 1000 objects"):
        held.register(made, presents(held._space, ["plant"], 1), 1)
