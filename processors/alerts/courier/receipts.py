"""Emergencies at Pushover that still ring: asked about, acknowledged here too, and stopped when their alerts are over.

A receipt stands on the broker as long as it matters, so that a courier that is started again goes on asking.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from processors.alerts.courier.desk import Publish
from processors.alerts.courier.pushover import ReceiptState
from processors.alerts.statement import RINGING, Statement
from twin.vocabulary import topics

RECEIPT = topics.ALERT_RECEIPT
ACK = topics.ALERT_ACK
RECEIPTS_MAX = 500
KEPT_S_MAX = 86_400.0
Episode = tuple[str, int]


class Ask(NamedTuple):
    """Ask what became of a receipt."""

    key: str
    receiver: str
    receipt: str


class Cancel(NamedTuple):
    """Stop an emergency."""

    key: str
    receiver: str
    receipt: str


class Acknowledge(NamedTuple):
    """Publish this command, not retained."""

    payload: bytes


@dataclass(slots=True)
class _Open:
    receiver: str
    receipt: str
    episodes: tuple[Episode, ...]
    until_s: float
    asked_s: float = 0.0
    by: str = ""


class Receipts:
    """See the module. `poll_s`: of each receiver, how far apart two questions have to be."""

    def __init__(self, poll_s: Mapping[str, float]) -> None:
        self._poll_s = poll_s
        self._open: dict[str, _Open] = {}
        self._asked_s: dict[str, float] = {}
        self._firing: frozenset[Episode] | None = None  # those that nobody has acknowledged; None: not known yet

    def found(self, key: str, payload: bytes) -> None:
        """A receipt stands on the broker, or was removed."""
        try:
            said = json.loads(payload) if payload else None
            if said is None:
                self._open.pop(key, None)
            elif key not in self._open and len(self._open) < RECEIPTS_MAX:
                episodes = tuple((str(name), int(start)) for name, start in said["episodes"])
                self._open[key] = _Open(str(said["receiver"]), str(said["receipt"]), episodes, float(said["until_s"]))
        except (ValueError, TypeError, KeyError, RecursionError):
            return

    def opened(self, key: str, receiver: str, receipt: str, statements: Iterable[Statement], wall_s: float) -> Publish:
        """An emergency has been sent."""
        episodes = [(statement.fingerprint, statement.episode) for statement in statements if statement.what in RINGING]
        document = {"receiver": receiver, "receipt": receipt, "episodes": episodes, "until_s": wall_s + KEPT_S_MAX}
        payload = json.dumps(document, separators=(",", ":")).encode()
        self.found(key, payload)
        return Publish(RECEIPT + key, payload)

    def state(self, document: Mapping[str, Any]) -> None:
        """The state of all alerts."""
        alerts = document.get("alerts")
        if isinstance(alerts, list) and not document.get("alerts_not_shown"):
            self._firing = frozenset((a["fingerprint"], a["episode"]) for a in alerts if a.get("phase") == "firing")

    def due(self, now_s: float, wall_s: float, free: frozenset[str]) -> list[Ask | Cancel | Publish | Acknowledge]:
        """Return what is to be done now, at most one question for each receiver that is free."""
        actions: list[Ask | Cancel | Publish | Acknowledge] = []
        asked: set[str] = set()
        for key, one in sorted(self._open.items(), key=lambda entry: entry[1].asked_s):
            name = one.receiver
            if wall_s > one.until_s or name not in self._poll_s:
                actions.append(self._closed(key))
                continue
            still = self._firing is None or any(episode in self._firing for episode in one.episodes)
            if one.by and not still:
                actions.append(self._closed(key))
            elif name in free and name not in asked and now_s - self._asked_s.get(name, -1e9) >= self._poll_s[name]:
                asked.add(name)
                one.asked_s = self._asked_s[name] = now_s
                if not still:
                    actions.append(Cancel(key, name, one.receipt))
                elif one.by:
                    actions += self._acknowledgements(key, one)
                else:
                    actions.append(Ask(key, name, one.receipt))
        return actions

    def answered(self, key: str, state: ReceiptState | None) -> list[Publish | Acknowledge]:
        """Take Pushover's answer."""
        one = self._open.get(key)
        if one is None or state is None:
            return []
        if state.acknowledged_by:
            one.by = state.acknowledged_by
            return list(self._acknowledgements(key, one))
        return [self._closed(key)] if state.is_over else []

    def cancelled(self, key: str, is_done: bool) -> list[Publish]:
        """Close a receipt that Pushover has stopped."""
        return [self._closed(key)] if is_done and key in self._open else []

    def _closed(self, key: str) -> Publish:
        self._open.pop(key, None)
        return Publish(RECEIPT + key, b"")

    def _acknowledgements(self, key: str, one: _Open) -> Iterable[Acknowledge]:
        for fingerprint, episode in one.episodes:
            if self._firing is None or (fingerprint, episode) in self._firing:
                command = {"id": f"{key}.{fingerprint}", "by": one.by, "fingerprint": fingerprint, "episode": episode}
                yield Acknowledge(json.dumps(command, separators=(",", ":")).encode())
