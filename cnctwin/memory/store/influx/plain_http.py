"""Requests to InfluxDB 1.x and VictoriaMetrics, and the questions in InfluxQL to all of InfluxDB: one client, plain HTTP."""

import base64
import gzip
import ssl
import time
from collections.abc import Mapping

import httpx

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import INFLUX2, VICTORIA, Address
from cnctwin.memory.store.influx.http_answer import answer, message, one_line
from cnctwin.memory.store.influx.server import ServerAwayError

GZIP_LEVEL = 1
CONNECT_S_MAX = 5.0


class PlainHttp:
    """A server over HTTP. Any thread."""

    def __init__(self, address: Address, *, timeout_s: float | None = None) -> None:
        self.address = address
        verify: ssl.SSLContext | bool = address.base.startswith("https:")
        if address.ca is not None:
            verify = ssl.create_default_context(cafile=str(address.ca))
        timeout = httpx.Timeout(timeout_s or address.timeout_s, connect=min(CONNECT_S_MAX, address.timeout_s))
        self._client = httpx.Client(base_url=address.base, headers=authorization(address), timeout=timeout, verify=verify)

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def post_lines(self, path: str, lines: bytes, parameters: Mapping[str, str]) -> None:
        """Write lines; raises a ServerAnswer where they were not taken."""
        try:
            done = self._client.post(
                path,
                params=parameters,
                content=gzip.compress(lines, GZIP_LEVEL),
                headers={"Content-Encoding": "gzip", "Content-Type": "text/plain; charset=utf-8"},
            )
        except httpx.HTTPError as error:
            raise ServerAwayError(self._trouble(error)) from None
        token = self.address.token
        if refusal := answer(
            self.address.base, done.status_code, done.text, done.headers.get("Retry-After"), now_s=time.time(), token=token
        ):
            raise refusal

    def get(self, path: str, parameters: Mapping[str, str | list[str]], *, method: str = "GET") -> httpx.Response:
        """Ask; StoreError where there is no good answer."""
        try:
            done = self._client.get(path, params=parameters) if method == "GET" else self._client.post(path, data=parameters)
        except httpx.HTTPError as error:
            raise StoreError(self._trouble(error)) from None
        if done.status_code >= 300:
            said = one_line(message(done.text), self.address.token)
            raise StoreError(f"{self.address.base}{path} says {done.status_code}: {said}")
        return done

    def _trouble(self, error: httpx.HTTPError) -> str:
        said = one_line(str(error) or type(error).__name__, self.address.token)
        return f"{self.address.base} does not answer: {said}; is the server up?"


def authorization(address: Address) -> dict[str, str]:
    """The header that lets us in: `user:password` as Basic, else a token as each server wants it."""
    if not address.token:
        return {}
    if address.kind != INFLUX2 and ":" in address.token:
        return {"Authorization": f"Basic {base64.b64encode(address.token.encode()).decode()}"}
    return {"Authorization": f"{'Bearer' if address.kind == VICTORIA else 'Token'} {address.token}"}
