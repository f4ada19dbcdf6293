"""Judges what an edge node sends by the rules for seq, bdSeq, births, aliases and QoS, with nothing but the bytes to go by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sparkplug.actions import Connect, Publish
from sparkplug.schema import PayloadMessage


@dataclass
class EdgeWatch:
    """Follows one edge node over all its connections; every breach of a rule is an AssertionError that quotes it."""

    will_bd_seq: int | None = None
    born: bool = False
    seq: int | None = None
    stamp: int = 0
    devices: set[str] = field(default_factory=set)
    owed_births: list[str] = field(default_factory=list)
    aliases: dict[int, tuple[str | None, str]] = field(default_factory=dict)

    def connecting(self, connect: Connect, bd_seq_before: int | None) -> None:
        """CONNECT: the will is the NDEATH of a session whose number is one more than the last one's."""
        topic, payload, qos, retain = connect.will
        assert topic.split("/")[2] == "NDEATH" and (qos, retain) == (1, False), "the will is an NDEATH, QoS 1, not retained"
        message = PayloadMessage.FromString(payload)
        assert not message.HasField("seq"), "an NDEATH carries no seq"
        self.will_bd_seq = _bd_seq(message)
        if bd_seq_before is not None:
            assert self.will_bd_seq == (bd_seq_before + 1) % 256, "each CONNECT takes the next bdSeq"
        self.born, self.seq, self.devices, self.owed_births = False, None, set(), []

    def sent(self, publish: Publish, declared: list[str]) -> None:
        """PUBLISH: `declared` are the devices that the application has declared at this moment."""
        topic, payload, qos, retain = publish
        verb, device = topic.split("/")[2], (topic.split("/")[4:] or [None])[0]
        message = PayloadMessage.FromString(payload)
        assert not retain, "no edge message is retained"
        assert qos == (1 if verb == "NDEATH" else 0), f"{verb} with QoS {qos}"
        assert message.HasField("timestamp") and message.timestamp >= self.stamp, "payload time stamps never go backwards"
        self.stamp = message.timestamp
        if verb == "NDEATH":
            assert not message.HasField("seq") and _bd_seq(message) == self.will_bd_seq, "NDEATH: the will's bdSeq and no seq"
            self.born = False
            return
        if verb == "NBIRTH":
            self._node_birth(message, declared)
        else:
            assert self.born, f"{verb} before NBIRTH"
            assert self.seq is not None
            assert message.seq == (self.seq + 1) % 256, f"{verb} with seq {message.seq} after {self.seq}"
        self.seq = message.seq
        if verb == "DBIRTH":
            assert device is not None
            if self.owed_births:
                assert device == self.owed_births.pop(0), "after NBIRTH the DBIRTHs of all devices follow"
            self.devices.add(device)
            self._births(device, message)
            return
        assert verb == "NBIRTH" or not self.owed_births, f"{verb} before the DBIRTHs of {self.owed_births}"
        if verb in ("NDATA", "DDATA"):
            assert device is None or device in self.devices, f"DDATA of {device}, which was not born"
            self._data(device, message)
        if verb == "DDEATH":
            assert device is not None
            self.devices.remove(device)

    def _node_birth(self, message: Any, declared: list[str]) -> None:
        assert message.HasField("seq") and message.seq == 0, "NBIRTH has seq 0"
        assert _bd_seq(message) == self.will_bd_seq, "NBIRTH has the bdSeq of the will"
        self.born, self.devices, self.owed_births, self.aliases = True, set(), list(declared), {}
        (control,) = (metric for metric in message.metrics if metric.name == "Node Control/Rebirth")
        assert control.boolean_value is False and control.datatype == 11 and not control.HasField("alias")
        self._births(None, message)

    def _births(self, device: str | None, message: Any) -> None:
        for alias in [alias for alias, (owner, _) in self.aliases.items() if owner == device]:
            del self.aliases[alias]
        for metric in message.metrics:
            assert metric.name and metric.HasField("datatype") and metric.HasField("timestamp")
            assert metric.is_null != (metric.WhichOneof("value") is not None), f"{metric.name}: a value or null, not both"
            if metric.HasField("alias"):
                assert metric.alias not in self.aliases, f"alias {metric.alias} twice in one edge node"
                self.aliases[metric.alias] = (device, metric.name)

    def _data(self, device: str | None, message: Any) -> None:
        assert message.metrics, "a data message has metrics"
        present = []
        for metric in message.metrics:
            assert not metric.name and not metric.HasField("datatype") and metric.HasField("timestamp")
            assert self.aliases[metric.alias][0] == device, "data uses an alias of its own birth"
            if not metric.is_historical:
                present.append(metric.timestamp)
        assert present == sorted(present), "metrics stand in the order of time"


def _bd_seq(message: Any) -> int:
    (metric,) = (metric for metric in message.metrics if metric.name == "bdSeq")
    assert metric.datatype == 4, "bdSeq is an Int64"
    return int(metric.long_value)
