"""The historian whose receipts an edge waits for: named by the configuration, or heard of on the broker.

    await_receipt = "auto"   from the moment in which the historian's STATE or one of its receipts came, over restarts
                             of the edge, until the retained STATE is removed
    await_receipt = true     always
    await_receipt = false    never

A historian that is offline, or a broker that has lost what it retained, ends nothing: its rows are what the edge keeps for it.
"""

import logging
import math
from collections import deque
from enum import StrEnum
from typing import Literal

from edge.running.receipts import Receipts
from sparkplug.actions import HostState
from sparkplug.topics import state_topic
from twin.vocabulary.nodes import HISTORIAN_NODE

LATE_S = 60.0
UNHEARD_S = 10.0  # a broker tells at once what it has retained; then no historian has been there
NO_HISTORIAN = "no historian has been heard of on this broker: nothing keeps history"
NOT_AWAITED = "no historian is waited for (await_receipt = false): what the broker has counts as kept"
STATES_MAX = 100
_log = logging.getLogger(__name__)


class _History(StrEnum):
    KEPT = "kept"
    LATE = "late"
    NONE = "none"
    NOT_AWAITED = "not awaited"


class Awaited:
    """All methods but `hear` are for one thread at a time.

    known: the historian that was heard of in an earlier life; host: the one that is waited for now, empty: none
    """

    def __init__(self, device: str, setting: bool | Literal["auto"], known: str, now_s: float) -> None:
        self._device, self._setting = device, setting
        self.host = HISTORIAN_NODE if setting is True else known if setting == "auto" else ""
        self._heard: deque[tuple[str, HostState | None]] = deque(maxlen=STATES_MAX)
        self._began_s, self._receipt_s = now_s, -math.inf
        self._told: _History | None = None

    @property
    def is_possible(self) -> bool:
        """Return False where the configuration rules receipts out."""
        return self._setting is not False

    def hear(self, host: str, state: HostState | None) -> None:
        """A historian has told its state; None: its retained STATE was removed. From any thread."""
        self._heard.append((host, state))

    def settle(self, receipt_s: float) -> bool:
        """Take in what was heard; return True where another host, or none, is waited for now.

        receipt_s: when the last receipt came
        """
        before = self.host
        while self._heard:
            host, state = self._heard.popleft()
            if self._setting == "auto":
                self.host = "" if state is None else host
        if receipt_s > self._receipt_s:
            self._receipt_s = receipt_s
            if self._setting == "auto" and not self.host:
                self.host = HISTORIAN_NODE
        return self.host != before

    def health(self, receipts: Receipts, now_s: float) -> dict[str, int | float | str | bool]:
        """Its metrics; what changes in kind is logged."""
        rows = receipts.rows
        silent_s = max(now_s - max(self._receipt_s, self._began_s), 0.0) if self.host and rows else 0.0
        kind = self._kind(silent_s)
        text = self._text(kind, rows, silent_s)
        if kind is not self._told and (kind is not _History.NONE or now_s - self._began_s >= UNHEARD_S):
            self._told = kind
            (_log.info if kind is _History.KEPT else _log.warning)("%s: %s", self._device, text)
        return {"health/awaited_rows": rows, "health/awaited_s": silent_s, "health/history": text}

    def _kind(self, silent_s: float) -> _History:
        if not self.is_possible:
            return _History.NOT_AWAITED
        if not self.host:
            return _History.NONE
        return _History.LATE if silent_s >= LATE_S else _History.KEPT

    def _text(self, kind: _History, rows: int, silent_s: float) -> str:
        if kind is _History.NOT_AWAITED:
            return NOT_AWAITED
        if kind is _History.NONE:
            return NO_HISTORIAN
        if kind is _History.KEPT:
            return f"rows are held until {self.host} has them"
        return (
            f"{self.host} has given no receipt for {silent_s / 60:.0f} min: {rows} rows wait for it, up to the limits of [store]"
            f"; start it, or, if it is no part of the plant any more, set await_receipt = false or clear the retained "
            f"{state_topic(self.host)}"
        )
