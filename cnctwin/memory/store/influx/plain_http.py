"""Requests to InfluxDB 1.x and VictoriaMetrics, and the questions in InfluxQL to all of InfluxDB: plain HTTP, within bounds.

Each request has one deadline for all of it, an answer has at most ANSWER_BYTES_MAX bytes, and one that is compressed is refused
(`processors.alerts.courier.exchange`): the server may be anybody who stands at its address.
"""

import base64
import gzip
import json
import ssl
import time
from collections.abc import Mapping
from typing import Any

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import INFLUX2, VICTORIA, Address
from cnctwin.memory.store.influx.http_answer import answer, message, one_line
from cnctwin.memory.store.influx.server import ServerAwayError
from processors.alerts.courier.exchange import Answer, Request, exchanged
from processors.alerts.courier.outcome import Outcome

GZIP_LEVEL = 1
ANSWER_BYTES_MAX = 128 * 1024 * 1024


class PlainHttp:
    """A server over HTTP. Any thread."""

    def __init__(self, address: Address, *, timeout_s: float | None = None) -> None:
        self.address = address
        self._timeout_s = timeout_s or address.timeout_s
        self._authorities = None if address.ca is None else ssl.create_default_context(cafile=str(address.ca))

    def post_lines(self, path: str, lines: bytes, parameters: Mapping[str, str]) -> None:
        """Write lines; raises a ServerAnswer where they were not taken."""
        headers = {"Content-Encoding": "gzip", "Content-Type": "text/plain; charset=utf-8"}
        done = self._asked("POST", path, headers, query=parameters, content=gzip.compress(lines, GZIP_LEVEL))
        if isinstance(done, Outcome):
            raise ServerAwayError(self._trouble(done.reason))
        token, said = self.address.token, done.body.decode(errors="replace")
        if refusal := answer(
            self.address.base, done.status, said, done.headers.get("Retry-After"), now_s=time.time(), token=token
        ):
            raise refusal

    def get(self, path: str, parameters: Mapping[str, str | list[str]], *, method: str = "GET") -> str:
        """Ask, and return the text of the answer; StoreError where there is no good one."""
        form = None if method == "GET" else {name: str(value) for name, value in parameters.items()}
        done = self._asked(method, path, {}, query=parameters if form is None else None, form=form)
        if isinstance(done, Outcome):
            raise StoreError(self._trouble(done.reason))
        said = done.body.decode(errors="replace")
        if done.status >= 300:
            raise StoreError(f"{self.address.base}{path} says {done.status}: {one_line(message(said), self.address.token)}")
        if done.wrong:
            raise StoreError(
                f"{self.address.base}{path}: the answer {done.wrong}; ask for less at once, or look who answers there"
            )
        return said

    def get_json(self, path: str, parameters: Mapping[str, str | list[str]], *, method: str = "GET") -> Any:
        """Ask, and return the document of the answer; StoreError where there is no good one."""
        try:
            return json.loads(self.get(path, parameters, method=method))
        except (ValueError, RecursionError):
            server = "a VictoriaMetrics" if self.address.kind == VICTORIA else "an InfluxDB"
            raise StoreError(f"{self.address.base}{path}: the answer is no JSON; is that {server}?") from None

    def _asked(self, method: str, path: str, headers: dict[str, str], **given: Any) -> Answer | Outcome:
        address = self.address
        headers |= authorization(address)
        request = Request(method, address.base + path, headers, secrets=(address.token,), authorities=self._authorities, **given)
        return exchanged(request, self._timeout_s, ANSWER_BYTES_MAX)

    def _trouble(self, reason: str) -> str:
        return f"{self.address.base} does not answer: {one_line(reason, self.address.token)}; is the server up?"


def authorization(address: Address) -> dict[str, str]:
    """The header that lets us in: `user:password` as Basic, else a token as each server wants it."""
    if not address.token:
        return {}
    if address.kind != INFLUX2 and ":" in address.token:
        return {"Authorization": f"Basic {base64.b64encode(address.token.encode()).decode()}"}
    return {"Authorization": f"{'Bearer' if address.kind == VICTORIA else 'Token'} {address.token}"}
