"""Anything may happen to the messages on their way; in the end the host's picture is the edge's truth."""

from __future__ import annotations

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.edge_session import REBIRTH
from sparkplug.metric import Change, MetricSpec
from sparkplug.quality import Quality
from sparkplug.values import Metric, Payload
from tests.depth import examples
from tests.sparkplug.simulated_edge import Edge
from tests.sparkplug.world import World

# Half the numbers of a full count: more lost in a row could be mistaken for a repetition (see test_sequence).
LOST_MAX = 120
DEVICES = ("okuma", "probe")
TYPES = (DataType.DOUBLE, DataType.DOUBLE, DataType.INT32, DataType.UINT32)  # the last two share a field on the wire
NAMES = ("load", "tool", "mode")
VALUES = {
    DataType.DOUBLE: st.floats(allow_nan=False),
    DataType.INT32: st.integers(-(2**31), 2**31 - 1),
    DataType.UINT32: st.integers(0, 2**32 - 1),
}
EDGES = st.integers(0, 1)
QUALITIES = st.sampled_from((Quality.GOOD, Quality.GOOD, Quality.BAD, Quality.STALE))


class Plant(RuleBasedStateMachine):
    """Two edge nodes (the second waits for the host), one host, one broker."""

    @initialize(connected=st.booleans())
    def begin(self, connected: bool) -> None:
        """Mostly everybody is there from the beginning."""
        self.world = World()
        self.lost = 0
        for edge in self.world.edges:
            self.world.declare(edge, "okuma", (MetricSpec("load", DataType.DOUBLE, unit="%"),))
        if connected:
            self.world.connect_host()
            for edge in self.world.edges:
                self.world.connect_edge(edge)
            self.world.quiesce()

    def edge(self, number: int) -> Edge:
        """One of the edges."""
        return self.world.edges[number]

    @rule(step_ms=st.integers(0, 2))
    def pace(self, step_ms: int) -> None:
        """From now on so much time passes with each step, perhaps none that a clock would show."""
        self.world.step_ms = step_ms

    @rule(number=EDGES, count=st.integers(1, 4), milliseconds=st.sampled_from((400, 2500)))
    def a_hole(self, number: int, count: int, milliseconds: int) -> None:
        """A few messages are lost, the next one arrives, and the host has time to think about it."""
        edge = self.edge(number)
        for beat in range(count + 1):
            self.world.publish(edge, None, [Change("beat", beat, self.world.now_ms)])
        if self.world.flight and self.lost + count <= LOST_MAX:
            self.lost += self.world.lose(max(len(self.world.flight) - count - 1, 0), count)
        self.world.deliver(len(self.world.flight))
        self.world.wait(milliseconds)
        while edge.inbox:
            self.world.deliver_to_edge(edge)
        self.world.deliver(len(self.world.flight))

    @rule(number=EDGES, data=st.data(), count=st.integers(1, 4))
    def publish(self, number: int, data: st.DataObject, count: int) -> None:
        """A few values change; their time stamps may lie behind, and some are history."""
        edge = self.edge(number)
        device = data.draw(st.sampled_from(sorted(edge.specs, key=str)), "device")
        changes = []
        for _ in range(count):
            spec = data.draw(st.sampled_from(edge.specs[device]), "metric")
            if spec.name == "beat":
                value = data.draw(st.integers(0, 2**31))
            else:
                value = data.draw(st.none() | VALUES[spec.datatype], "value")
            stamp_ms = self.world.now_ms - data.draw(st.integers(0, 50), "age")
            quality = data.draw(QUALITIES, "quality")
            history = data.draw(st.integers(0, 5), "history") == 0
            reason = None if quality is Quality.GOOD else "because"
            changes.append(Change(spec.name, value, stamp_ms, quality, reason, history))
        self.world.publish(edge, device, changes)

    @rule(number=EDGES, count=st.sampled_from((3, 10, 127, 255, 256, 300)))
    def publish_many(self, number: int, count: int) -> None:
        """So many messages that seq begins again; half of them arrive meanwhile."""
        edge = self.edge(number)
        for beat in range(count):
            self.world.publish(edge, None, [Change("beat", beat, self.world.now_ms)])
            if len(self.world.flight) > 40:
                self.world.deliver(20)

    @rule(number=EDGES, device=st.sampled_from(DEVICES), types=st.lists(st.sampled_from(TYPES), min_size=1, max_size=3))
    def declare(self, number: int, device: str, types: list[DataType]) -> None:
        """A device comes, or declares other metrics, perhaps with the same names and other types."""
        specs = tuple(MetricSpec(name, datatype) for name, datatype in zip(NAMES, types, strict=False))
        self.world.declare(self.edge(number), device, specs)

    @rule(number=EDGES, device=st.sampled_from(DEVICES))
    def remove(self, number: int, device: str) -> None:
        """A device goes."""
        edge = self.edge(number)
        if device in edge.specs:
            self.world.remove(edge, device)

    @rule(number=EDGES)
    def connect_or_cut_edge(self, number: int) -> None:
        """The connection of an edge breaks, or is made again; the will waits at the broker."""
        edge = self.edge(number)
        if edge.connected:
            self.world.cut_edge(edge)
        else:
            self.world.connect_edge(edge)

    @rule(number=EDGES)
    def close_edge(self, number: int) -> None:
        """An edge ends by its own will."""
        self.world.close_edge(self.edge(number))

    @rule(number=EDGES, remembers=st.booleans())
    def restart_edge(self, number: int, remembers: bool) -> None:
        """The process of an edge is killed and started again."""
        self.world.restart_edge(self.edge(number), remembers_bd_seq=remembers)
        self.world.connect_edge(self.edge(number))

    @rule(will_is_late=st.booleans(), clean=st.booleans())
    def connect_or_cut_host(self, will_is_late: bool, clean: bool) -> None:
        """The host goes or comes, and with it its STATE."""
        if not self.world.host.online:
            self.world.connect_host()
        elif clean:
            self.world.close_host()
        else:
            self.world.cut_host(will_is_late=will_is_late)

    @precondition(lambda self: self.world.late_host_wills)
    @rule()
    def late_will_of_the_host(self) -> None:
        """STATE flaps: the will of an earlier connection comes only now."""
        self.world.deliver_host_will()

    @precondition(lambda self: self.world.late_wills)
    @rule(data=st.data())
    def late_will_of_an_edge(self, data: st.DataObject) -> None:
        """The will of an earlier connection comes only now."""
        self.world.deliver_will(data.draw(st.integers(0, len(self.world.late_wills) - 1)))

    @rule(number=EDGES)
    def somebody_asks_for_a_rebirth(self, number: int) -> None:
        """Another host wants the births."""
        edge = self.edge(number)
        payload = encode(Payload(self.world.now_ms, (Metric(REBIRTH, True, DataType.BOOLEAN, self.world.now_ms),)))
        self.world.command(edge, f"spBv1.0/cnc/NCMD/{edge.node.node}", payload)

    @precondition(lambda self: any(edge.inbox for edge in self.world.edges))
    @rule(lost=st.booleans())
    def edges_read(self, lost: bool) -> None:
        """A message reaches its edge, or a command is lost."""
        for edge in self.world.edges:
            if edge.inbox and lost and "NCMD" in edge.inbox[0][0]:
                edge.inbox.pop(0)
            elif edge.inbox:
                self.world.deliver_to_edge(edge)

    @precondition(lambda self: self.world.flight)
    @rule(count=st.integers(1, 30))
    def host_reads(self, count: int) -> None:
        """Some messages reach the host."""
        self.world.deliver(count)

    @precondition(lambda self: self.world.flight)
    @rule(data=st.data(), count=st.integers(1, 20))
    def messages_are_lost(self, data: st.DataObject, count: int) -> None:
        """Messages never arrive."""
        index = data.draw(st.integers(0, len(self.world.flight) - 1))
        self.lost += self.world.lose(index, min(count, LOST_MAX - self.lost))

    @precondition(lambda self: self.world.flight)
    @rule(data=st.data(), later_by=st.integers(0, 12))
    def a_message_comes_twice(self, data: st.DataObject, later_by: int) -> None:
        """A message is repeated."""
        self.world.repeat(data.draw(st.integers(0, len(self.world.flight) - 1)), later_by)

    @precondition(lambda self: self.world.flight)
    @rule(data=st.data(), later_by=st.integers(1, 12))
    def a_message_is_delayed(self, data: st.DataObject, later_by: int) -> None:
        """Messages change places."""
        self.world.delay(data.draw(st.integers(0, len(self.world.flight) - 1)), later_by)

    @rule(milliseconds=st.sampled_from((1, 100, 1000, 2000, 2500)))
    def time_passes(self, milliseconds: int) -> None:
        """Time passes; what is on its way for longer is no longer only late."""
        self.world.wait(milliseconds)

    @rule()
    def quiet(self) -> None:
        """All is delivered and answered: the picture is the truth."""
        self.world.quiesce()
        self.lost = 0
        self.world.check_quiet()

    @invariant()
    def always(self) -> None:
        """What holds at every moment."""
        if hasattr(self, "world"):
            self.world.check_always()

    def teardown(self) -> None:
        """However it went, it ends well."""
        if hasattr(self, "world"):
            self.quiet()
            self.always()


TestPlant = Plant.TestCase
TestPlant.settings = settings(
    max_examples=examples(150),
    stateful_step_count=50,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
