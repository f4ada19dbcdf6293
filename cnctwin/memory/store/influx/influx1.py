"""InfluxDB 1.x as a server for lines (https://docs.influxdata.com/influxdb/v1/tools/api/#write-http-endpoint).

What InfluxDB 2 has as buckets are databases here, so that both are asked in the same words; they are made where they are missing,
without an end: `docs/how-to/influx.md` says how to give them one. An acknowledged write is in its log on
the disk (wal-fsync-delay 0).
"""

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import Address
from cnctwin.memory.store.influx.influxql import identifier
from cnctwin.memory.store.influx.plain_http import PlainHttp
from cnctwin.memory.store.influx.server import RefusedError, ServerAwayError


class Influx1:
    """An InfluxDB 1.x."""

    settle_s = 0.0

    def __init__(self, address: Address) -> None:
        self._http = PlainHttp(address)
        self._address = address

    def write(self, bucket: str, lines: bytes) -> None:
        """Have the lines taken, or raise a ServerAnswer."""
        try:
            self._write(bucket, lines)
        except (ServerAwayError, RefusedError) as missing:
            if "database not found" not in str(missing):
                raise
            self._make(self._address.bucket(bucket))
            self._write(bucket, lines)

    def _write(self, bucket: str, lines: bytes) -> None:
        self._http.post_lines("/write", lines, {"db": self._address.bucket(bucket), "precision": "ns"})

    def _make(self, database: str) -> None:
        try:
            told = self._http.get_json("/query", {"q": f"CREATE DATABASE {identifier(database)}"}, method="POST")
            trouble = next((result["error"] for result in told.get("results", []) if "error" in result), "")
        except (StoreError, AttributeError, TypeError) as error:
            trouble = str(error)
        if trouble:
            raise ServerAwayError(
                f"database {database!r} is missing and cannot be made: {trouble}; make it, see docs/how-to/influx.md"
            )

    def incarnation(self) -> str:
        """Not asked: an acknowledged write is on the disk."""
        return ""

    def close(self) -> None:
        """Nothing stays open."""
