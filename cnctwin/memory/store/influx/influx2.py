"""InfluxDB 2 as a server for lines, through influxdb-client (https://docs.influxdata.com/influxdb/v2/api/#operation/PostWrite).

The client writes synchronously what we hand it, and never retries: its own batching keeps what it could not send in memory only,
gives a batch up after five attempts or 180 s, and then drops it with no more than a callback. Batches, retries and what is lost
are ours, in the ring. Lines are bytes already, so nothing of the client's data model is built.
"""

import time
from collections.abc import Mapping
from typing import Any

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import Address
from cnctwin.memory.store.influx.http_answer import answer, one_line
from cnctwin.memory.store.influx.server import ServerAwayError

_NS: Any = "ns"  # what the client has as WritePrecision.NS, typed as that class


class Influx2:
    """An InfluxDB 2."""

    settle_s = 0.0

    def __init__(self, address: Address) -> None:
        try:
            from influxdb_client.client.influxdb_client import InfluxDBClient  # noqa: PLC0415 — an extra
            from influxdb_client.client.write_api import SYNCHRONOUS  # noqa: PLC0415
        except ImportError as error:
            raise StoreError("InfluxDB 2 needs influxdb-client: install cnctwin[influx]") from error
        self._address = address
        ca: dict[Any, Any] = {} if address.ca is None else {"ssl_ca_cert": str(address.ca)}
        self._client = InfluxDBClient(
            url=address.base,
            token=address.token,
            org=address.org,
            timeout=round(address.timeout_s * 1000),
            enable_gzip=True,
            retries=False,
            **ca,
        )
        self._api = self._client.write_api(write_options=SYNCHRONOUS)

    def write(self, bucket: str, lines: bytes) -> None:
        """Have the lines taken, or raise a ServerAnswer."""
        from influxdb_client.client.exceptions import InfluxDBError  # noqa: PLC0415
        from influxdb_client.rest import ApiException  # noqa: PLC0415
        from urllib3.exceptions import HTTPError  # noqa: PLC0415

        address = self._address
        try:
            self._api.write(bucket=address.bucket(bucket), record=lines, write_precision=_NS)
        except ApiException as error:
            headers: Mapping[str, str] = error.headers or {}
            said = str(error.body or error.reason or "")
            refusal = answer(
                address.base, error.status or 0, said, headers.get("Retry-After"), now_s=time.time(), token=address.token
            )
            raise refusal or ServerAwayError(f"{address.base}: {one_line(said, address.token)}") from None
        except (HTTPError, InfluxDBError, OSError) as error:
            said = one_line(str(error) or type(error).__name__, address.token)
            raise ServerAwayError(f"{address.base} does not answer: {said}; is the server up?") from None

    def incarnation(self) -> str:
        """Not asked: an acknowledged write is on the disk."""
        return ""

    def close(self) -> None:
        """Close the connections."""
        self._client.close()  # type: ignore[no-untyped-call]
