#!/usr/bin/env python3
"""CPU time of one 20-metric message from socket to published result, split into its stages, beside two yardsticks.

    .venv/bin/python benchmarks/sample_path.py [--messages N] [--json]

All figures are CPU time of the processor's process per message (all threads), from one run on one machine: read the ratios, not
the microseconds. The same bytes go through each variant: 20 metrics with alias, time stamp and double in; mean, minimum, maximum
and spread out.

* floor: parse, read 20 values, compute, build and serialise 4 values, in a loop, with no transport and no checks. What any Python
  program on protobuf must spend.
* plain loop: what a good engineer writes in an afternoon: paho's own network loop, protobuf in its callback, publish. It knows no
  births, order, quality, state or restarts.
* ours: HostApplication, processor runtime (engine, fold, report by exception, ledger), EdgeNode. All three listen to the one
  source only; in a plant a processor also receives, and throws away, what other processors publish in its group.
"""

import argparse
import gc
import json
import multiprocessing
import socket
import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from benchmarks.hall.packets import publish
from cnctwin.processes.port import free_port
from cnctwin.processes.private_broker import PrivateBroker
from processors.actions import Publish as PublishAction
from processors.config import Configuration, ProcessorConfig
from processors.contract import NoState, Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.running.cycles import SELDOM
from processors.running.engine import Engine
from processors.running.runner import GATHER_S
from processors.running.runtime import runner_of
from sparkplug.actions import Publish
from sparkplug.admission.limits import Limits
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.schema import PayloadMessage
from sparkplug.transport.loop import Loop

SIGNALS = tuple(f"axis_{i}_pos_mm" for i in range(20))
RESULTS = ("twin/mean_mm", "twin/low_mm", "twin/high_mm", "twin/spread_mm")
# The source sends more than a node of a plant may.
FLAT_OUT = Limits(messages_a_second_max=1_000_000, messages_at_once_max=10_000_000, data_bytes_at_once_max=1 << 40)
SOURCE = NodeId("cnc", "edge-bench")
START_MS = 1_790_000_000_000


def figures(values: list[float]) -> tuple[float, float, float, float]:
    """Return what every variant computes."""
    low, high = min(values), max(values)
    return sum(values) / len(values), low, high, high - low


def step(_config: ProcessorConfig, state: NoState, sample: Sample) -> tuple[NoState, tuple[Output, ...]]:
    """The fold of our variant."""
    if sample.kind is not SampleKind.DATA:
        return state, ()
    row = sample.row
    values: list[Any] = [row[name].value for name in SIGNALS]
    return state, tuple(Output(name, value) for name, value in zip(RESULTS, figures(values), strict=True))


PROBE = Processor(
    name="bench",
    version=1,
    inputs=frozenset(SIGNALS),
    outputs=tuple(OutputSpec(name, DataType.DOUBLE, "mm", "a figure of the benchmark", Provenance.MODELLED) for name in RESULTS),
    config=ProcessorConfig,
    state=NoState,
    initial=lambda _config: NoState(),
    step=step,
)


def source_messages(count: int) -> tuple[list[Publish], list[Publish]]:
    """The births and `count` data messages of a machine, as an edge node sends them."""
    session = EdgeNodeSession(SOURCE, now_ms=START_MS)
    session.declare_device("vmc", [MetricSpec(name, DataType.DOUBLE, "mm") for name in SIGNALS], START_MS)
    session.connecting(0, START_MS)
    births = [action for action in session.connected(START_MS) if isinstance(action, Publish)]
    data = []
    for i in range(count):
        now_ms = START_MS + 10 * (i + 1)
        changes = [Change(name, 100.0 + i * 0.01 + k, now_ms) for k, name in enumerate(SIGNALS)]
        data += [action for action in session.publish("vmc", changes, now_ms) if isinstance(action, Publish)]
    return births, data


# The load: another process, a bare socket, packets made beforehand.


def load(port: int, births: list[Publish], data: list[Publish], rate_hz: float, go: Any) -> None:
    """Send the births, wait for the word, then the data: in bursts of 50, or one by one at `rate_hz`."""
    with socket.create_connection(("127.0.0.1", port)) as sock:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.sendall(b"\x10\x11\x00\x04MQTT\x04\x02\x00\x00\x00\x05bench")
        sock.recv(4)
        sock.sendall(b"".join(publish(message.topic, message.payload) for message in births))
        go.wait()
        packets = [publish(message.topic, message.payload) for message in data]
        size = 1 if rate_hz else 50
        started_s = time.monotonic()
        for first in range(0, len(packets), size):
            sock.sendall(b"".join(packets[first : first + size]))
            due_s = started_s + (first + size) / (rate_hz or 8000.0)
            time.sleep(max(0.0, due_s - time.monotonic()))
        time.sleep(0.5)


def under_load(  # noqa: PLR0917
    port: int, count: int, rate_hz: float, ready: Callable[[], bool], reset: Callable[[], None], done: Callable[[], bool]
) -> float:
    """CPU time of this process per message while another one sends, µs."""
    births, data = source_messages(count)
    context = multiprocessing.get_context("fork")
    go = context.Event()
    sender = context.Process(target=load, args=(port, births, data, rate_hz, go), daemon=True)
    sender.start()
    _wait(ready, "the births did not arrive")
    time.sleep(0.3)
    reset()
    before_s = time.process_time()
    go.set()
    _wait(done, "not every message arrived")
    spent_s = time.process_time() - before_s
    sender.join(10)
    return spent_s / count * 1e6


def _wait(condition: Callable[[], bool], complaint: str, seconds: float = 120.0) -> None:
    deadline_s = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline_s:
            raise SystemExit(complaint)
        time.sleep(0.02)


# The variants.


def ours(port: int, count: int, rate_hz: float) -> float:
    """The processor as it runs in production."""
    runner = runner_of([(PROBE, Configuration(ProcessorConfig, {}))], BrokerAddress(port=port), limits=FLAT_OUT)
    (worker,) = runner.workers
    stop = threading.Event()
    thread = threading.Thread(target=runner.run, args=(stop,), daemon=True)
    thread.start()
    _wait(lambda: worker.online, "the processor does not come online")
    ledger = worker.engine.ledger
    already = 0

    def reset() -> None:
        nonlocal already
        already = ledger.emitted

    try:
        return under_load(port, count, rate_hz, lambda: ledger.emitted >= 1, reset, lambda: ledger.emitted - already >= count)
    finally:
        stop.set()
        thread.join(10)


def plain_loop(port: int, count: int, rate_hz: float) -> float:
    """paho's own loop, protobuf in its callback."""
    seen = 0
    client = paho.Client(CallbackAPIVersion.VERSION2, "plain")
    result_topic = "spBv1.0/cnc/DDATA/twin-plain/vmc"

    def on_message(_client: Any, _userdata: Any, message: paho.MQTTMessage) -> None:
        nonlocal seen
        seen += 1
        if "/DDATA/" in message.topic:
            client.publish(result_topic, floor_step(message.payload))

    client.on_message = on_message
    client.connect("127.0.0.1", port)
    client.subscribe(f"spBv1.0/{SOURCE.group}/+/{SOURCE.node}/#")
    client.loop_start()
    already = 0

    def reset() -> None:
        nonlocal already
        already = seen

    try:
        return under_load(port, count, rate_hz, lambda: seen >= 1, reset, lambda: seen - already >= count)
    finally:
        client.disconnect()
        client.loop_stop()


def transport(port: int, count: int, rate_hz: float) -> float:
    """Our transport alone: take each message, hand it to the thread that polls, send a ready-made answer."""
    seen = 0
    broker = BrokerAddress(port=port)
    loop = Loop()
    host = HostApplication(broker, "transport", (f"spBv1.0/{SOURCE.group}/+/{SOURCE.node}/#",), loop=loop, limits=FLAT_OUT)
    edge = EdgeNode(broker, NodeId("cnc", "twin-transport"), loop=loop)
    answer = (Publish("spBv1.0/cnc/DDATA/twin-transport/vmc", b"x" * 90),)
    stop = threading.Event()

    event = HostEvent(EventKind.DATA, SOURCE, "vmc", 0)

    def serve() -> None:
        nonlocal seen
        # Everything of the host application but its session: nothing is decoded.
        host._session.message = lambda _topic, _payload, _now_ms: [event]  # type: ignore[method-assign]
        while not stop.is_set():
            for _ in host.poll(0.05, GATHER_S if rate_hz else 0.0):
                seen += 1
                edge._connection.send(answer)

    host.start()
    edge.start()
    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    _wait(lambda: host.online and edge.online, "the transport does not come online")
    already = 0

    def reset() -> None:
        nonlocal already
        already = seen

    try:
        return under_load(port, count, rate_hz, lambda: seen >= 2, reset, lambda: seen - already >= count)
    finally:
        stop.set()
        thread.join(10)
        host.stop()
        edge.stop()


# The stages, each in a loop of its own.


def floor_step(payload: bytes) -> bytes:
    """Bytes in, bytes out, and nothing that is not needed for them."""
    message = PayloadMessage.FromString(payload)
    values = figures([metric.double_value for metric in message.metrics])
    stamp = message.timestamp
    answer = PayloadMessage(timestamp=stamp, seq=0)
    add = answer.metrics.add
    for alias, value in enumerate(values, start=1):
        add(alias=alias, timestamp=stamp, double_value=value)
    data: bytes = answer.SerializeToString()
    return data


def timed(work: Callable[[], None], count: int) -> float:
    """CPU time of `work` per message, µs."""
    before_s = time.process_time()
    work()
    return (time.process_time() - before_s) / count * 1e6


def stages(count: int) -> dict[str, float]:
    """Decode, fold and encode, each on its own."""
    births, data = source_messages(count)
    usual = gc.get_threshold()
    gc.set_threshold(*SELDOM)  # as a process of processors has it
    session = HostSession("bench", chance=Random(0))
    session.connected(START_MS)
    engine = Engine(PROBE, Configuration(ProcessorConfig, {}))
    out = EdgeNodeSession(NodeId("cnc", PROBE.node))
    out.declare_device("vmc", [spec.metric() for spec in PROBE.outputs], START_MS)
    out.connecting(0, START_MS)
    out.connected(START_MS)
    for message in births:
        for event in session.message(message.topic, message.payload, START_MS):
            engine.feed(event, 0.0)
    events, actions = [], []
    result = {"floor": timed(lambda: [floor_step(message.payload) for message in data] and None, count)}
    result["decode"] = timed(lambda: [events.extend(session.message(m.topic, m.payload, START_MS)) for m in data] and None, count)
    result["fold"] = timed(lambda: [actions.extend(engine.feed(event, 0.0)) for event in events] and None, count)
    published = [action for action in actions if isinstance(action, PublishAction)]
    assert len(published) == count, "every message must bring a result"
    result["encode"] = timed(lambda: [out.publish(e.machine, e.changes, START_MS) for e in published] and None, count)
    gc.set_threshold(*usual)
    return result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    count = options.messages
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        broker = PrivateBroker(Path(folder), free_port())
        broker.start()
        try:
            for _ in range(options.rounds):
                row = stages(count)
                row["plain"] = plain_loop(broker.port, count, 0.0)
                row["ours"] = ours(broker.port, count, 0.0)
                row["transport"] = transport(broker.port, count, 0.0)
                row["transport at 500/s"] = transport(broker.port, min(count, 2500), 500.0)
                row["plain at 500/s"] = plain_loop(broker.port, min(count, 2500), 500.0)
                row["ours at 500/s"] = ours(broker.port, min(count, 2500), 500.0)
                rows.append(row)
        finally:
            broker.stop()
    figure = {name: statistics.median(row[name] for row in rows) for name in rows[0]}
    figure["rest of the loop"] = figure["ours"] - sum(figure[name] for name in ("transport", "decode", "fold", "encode"))
    if options.json:
        print(json.dumps(figure))
        return
    print(f"CPU time per 20-metric message, µs, median of {options.rounds} rounds of {count:,} messages")
    for name in ("transport", "decode", "fold", "encode", "rest of the loop"):
        print(f"  {name:<20}{figure[name]:8.1f}")
    print(f"  {'ours, in all':<20}{figure['ours']:8.1f}   {figure['ours'] / figure['plain']:.2f} × the plain loop")
    print(f"  {'plain paho loop':<20}{figure['plain']:8.1f}")
    print(f"  {'codec floor':<20}{figure['floor']:8.1f}")
    slowly = figure["ours at 500/s"] / figure["plain at 500/s"]
    print(f"  {'ours at 500/s':<20}{figure['ours at 500/s']:8.1f}   {slowly:.2f} × the plain loop")
    print(f"  {'plain at 500/s':<20}{figure['plain at 500/s']:8.1f}")
    print(f"  {'transport at 500/s':<20}{figure['transport at 500/s']:8.1f}")


if __name__ == "__main__":
    main()
