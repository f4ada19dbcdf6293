"""An edge that nobody asked for: what it sends is drawn from a grammar of attacks, each decodable or nearly so.

names      of nodes, devices and metrics: long, escaped to three times their length, with control characters, `jobs`, of our own
stamps     0, now, years ahead, 2^63, 2^64 - 1
sizes      births of a thousand metrics, strings of a megabyte, arrays, devices by the hundred
numbers    wrong sequence numbers, aliases that no birth has, one alias twice, deaths that are not due
floods     hundreds of messages a second
bytes      payloads that are no Sparkplug at all
"""

from random import Random
from typing import TYPE_CHECKING, Any

from sparkplug.actions import Publish
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.values import Metric, Payload
from tests.plant.simulation.broker import ENDED
from tests.plant.simulation.kernel import EPOCH_S

if TYPE_CHECKING:
    from tests.plant.simulation.plant import Plant

NODES = ("edge-evil", "edge-%41", "edge-" + "x" * 300, "twin-evil", "edge-evil\x01")
DEVICES = (
    "evil",
    "%" * 30_000,
    "jobs",
    "e" * 20_000,
    "evil\x07",
    "evil\u0085x",
    "ĕvil",
    "m9",
    "cell 4%",
    "constructor",
    "__proto__",
)
METRICS = (
    "spindle_rpm",
    "spindle_load_pct",
    "x" * 70_000,
    "a\x01b",
    "a+b#",
    "/",
    "tool_number",
    "%" * 25_000,
    "edge_sequence",
    "\ufdd0",
)
STAMPS = (0, 1, "now", "ahead", 1 << 53, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)


class Hostile:
    """One hostile edge, for some seconds. It never claims the name of a machine of the plant."""

    def __init__(self, plant: "Plant", seed: int, lasts_s: float) -> None:
        self._plant, self._kernel, self._broker = plant, plant.kernel, plant.broker
        self._chance = Random(seed)
        self._until_s = self._kernel.now_s + min(lasts_s, 4.0)
        self._node = self._chance.choice(NODES)
        self._device = self._chance.choice(DEVICES)
        self._is_flood = self._chance.random() < 0.3
        self._seq = 0
        self._link: Any = None

    def begin(self) -> None:
        """Connect, and send until the time is over."""
        self._kernel.note("hostile", self._node[:40], self._device[:40])
        self._step()

    def _step(self) -> None:
        now_s = self._kernel.now_s
        if now_s >= self._until_s:
            if self._link is not None:
                self._broker.disconnect(self._link, with_will=False)
            return
        if self._link is None:
            self._link = self._broker.dial(f"evil-{self._chance.randrange(3)}", None, self._received)
            if self._link is not None:
                self._born()
        else:
            for _ in range(self._chance.randint(5, 25) if self._is_flood else 1):
                self._send()
        self._kernel.at(now_s + (0.1 if self._is_flood else self._chance.uniform(0.02, 0.5)), self._step)

    def _received(self, what: str, _: object) -> None:
        if what == ENDED:
            self._link = None

    # What it sends.

    def _born(self) -> None:
        self._seq = 0
        self._publish("NBIRTH", None, (Metric("bdSeq", 0, DataType.INT64, self._now_ms()),))
        for _ in range(self._chance.choice((1, 1, 1, 30))):
            self._publish("DBIRTH", self._device, self._metrics())
            if self._chance.random() < 0.5:
                self._device = (
                    self._chance.choice(DEVICES) if self._chance.random() < 0.5 else f"evil{self._chance.randrange(200)}"
                )

    def _send(self) -> None:
        kind = self._chance.choices(
            ("DDATA", "DBIRTH", "NBIRTH", "DDEATH", "NDEATH", "bytes", "NDATA", "plain"), (20, 3, 1, 1, 1, 2, 2, 1)
        )[0]
        if kind == "NBIRTH":
            self._born()
        elif kind == "bytes":
            self._bytes()
        elif kind == "plain":
            topic = self._chance.choice(
                ("spBv1.0/cnc/DDATA/x", "spBv1.0/cnc/DDATA/edge-evil/evil/more", "cnc/evil/x", "spBv1.0/STATE/evil")
            )
            self._broker.publish(self._link, Publish(topic, b"{}"))
        elif kind == "NDEATH":
            metric = Metric("bdSeq", self._chance.choice((0, 1, 255)), DataType.INT64, self._now_ms())
            self._broker.publish(
                self._link, Publish(f"spBv1.0/cnc/NDEATH/{self._node}", encode(Payload(self._now_ms(), (metric,))))
            )
        else:
            self._publish(kind, None if kind == "NDATA" else self._device, self._metrics(kind == "DDATA"))

    def _bytes(self) -> None:
        payload = self._chance.randbytes(self._chance.choice((0, 1, 30, 5_000)))
        self._broker.publish(self._link, Publish(f"spBv1.0/cnc/DDATA/{self._node}/{self._device}", payload))

    def _metrics(self, is_data: bool = False) -> tuple[Metric, ...]:
        chance = self._chance
        names: list[str]
        if chance.random() < 0.1 and not is_data:
            names = [f"metric {n}" for n in range(chance.choice((200, 1_000)))]
        else:
            names = chance.sample(METRICS, chance.randint(1, 4))
        return tuple(self._metric(name, number, is_data) for number, name in enumerate(names, start=1))

    def _metric(self, name: str, number: int, is_data: bool) -> Metric:
        chance = self._chance
        alias = None if chance.random() < 0.5 else chance.choice((number, number, 1, 9_999))
        value, datatype = chance.choice(
            (
                (6_666.0, DataType.DOUBLE),
                (float("nan"), DataType.DOUBLE),
                (7, DataType.INT64),
                ("x" * chance.choice((1, 1_000, 20_000)), DataType.STRING),
                (True, DataType.BOOLEAN),
                (None, DataType.DOUBLE),
                ((1 << 63) + 5, DataType.UINT64),
                (tuple(float(n) for n in range(chance.choice((2, 3_000)))), DataType.DOUBLE_ARRAY),
            )
        )
        return Metric(
            None if is_data and alias is not None and chance.random() < 0.7 else name, value, datatype, self._stamp(), alias
        )

    def _stamp(self) -> int:
        stamp = self._chance.choice(STAMPS) if self._chance.random() < 0.4 else "now"
        if isinstance(stamp, int):
            return stamp
        return self._now_ms() + (0 if stamp == "now" else 28_000_000_000_000)

    def _now_ms(self) -> int:
        return round((EPOCH_S + self._kernel.now_s) * 1000)

    def _publish(self, verb: str, device: str | None, metrics: tuple[Metric, ...]) -> None:
        seq = self._seq if self._chance.random() < 0.9 else self._chance.randrange(256)
        self._seq = (self._seq + 1) % 256
        topic = f"spBv1.0/cnc/{verb}/{self._node}" + ("" if device is None else f"/{device}")
        try:
            payload = encode(Payload(self._stamp() if self._chance.random() < 0.1 else self._now_ms(), metrics, seq=seq))
        except Exception:  # it cannot even be written
            payload = b"\x08"
        self._broker.publish(self._link, Publish(topic, payload))
