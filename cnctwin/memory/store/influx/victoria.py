"""VictoriaMetrics as a server for lines (https://docs.victoriametrics.com/single-server-victoriametrics/#how-to-send-data-from-influxdb-compatible-agents-such-as-telegraf).

It has no log on the disk before it acknowledges: what it took in the last seconds is lost when it is killed. So what was sent stays
in the ring until the server has lived on for `settle_s`; where it has started again meanwhile, that is sent once more.
"""  # noqa: E501 — the address

import logging
import re

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import Address
from cnctwin.memory.store.influx.plain_http import PlainHttp
from cnctwin.memory.store.influx.server import ServerAwayError

SETTLE_S = 10.0
_START = re.compile(r"^process_start_time_seconds (\S+)", re.M)
_log = logging.getLogger(__name__)
_DEDUPLICATED = re.compile(r'^flag\{name="dedup\.minScrapeInterval", value="([^"]*)"', re.M)


class Victoria:
    """A single VictoriaMetrics."""

    def __init__(self, address: Address, *, settle_s: float = SETTLE_S) -> None:
        self._http = PlainHttp(address)
        self.settle_s, self._advised = settle_s, False

    def write(self, bucket: str, lines: bytes) -> None:
        """Have the lines taken, or raise a ServerAnswer; it has no buckets, the measurement tells raw from derived."""
        self._http.post_lines("/write", lines, {"precision": "ns"})

    def incarnation(self) -> str:
        """The second at which the server's process was started."""
        metrics = self._metrics()
        found = _START.search(metrics)
        if not self._advised and not deduplicates(metrics):
            self._advised = True
            _log.warning(
                "%s keeps twice what is sent twice (readers here see it once); start it with -dedup.minScrapeInterval=1ms",
                self._http.address.base,
            )
        if found is None:
            raise ServerAwayError(f"{self._http.address.base}/metrics does not say when the server was started")
        return found[1]

    def _metrics(self) -> str:
        try:
            return self._http.get("/metrics", {})
        except StoreError as error:
            raise ServerAwayError(str(error)) from None

    def close(self) -> None:
        """Nothing stays open."""


def deduplicates(metrics: str) -> bool:
    """Return True if the server's flags say that it keeps a sample once that comes twice.

    >>> deduplicates('flag{name="dedup.minScrapeInterval", value="1ms", is_set="true"} 1')
    True
    """
    found = _DEDUPLICATED.search(metrics)
    return found is not None and found[1] not in {"", "0s", "0"}
