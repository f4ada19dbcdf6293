"""The address of a server: a URL without secrets, and the secret from the environment or a file.

influx+https://host:8086?org=plant&bucket_prefix=hall1_&ca=/etc/ssl/plant.pem&also=/var/lib/cnctwin/store
influx1+http://host:8086
victoriametrics+http://host:8428
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from cnctwin.memory.store.contract import StoreError
from sparkplug.shown_address import shown_address

PINNED = "cnc_pinned"
"""The bucket, without an end, that holds copies of what was pinned, beside those named by measurement."""
TOKEN, TOKEN_FILE = "CNCTWIN_INFLUX_TOKEN", "CNCTWIN_INFLUX_TOKEN_FILE"
INFLUX2, INFLUX1, VICTORIA = "influx", "influx1", "victoriametrics"
_OPTIONS = {
    INFLUX2: {"org", "bucket_prefix", "ca", "also", "timeout_s"},
    INFLUX1: {"bucket_prefix", "ca", "also", "timeout_s"},
    VICTORIA: {"ca", "also", "timeout_s"},
}
SCHEMES = tuple(f"{kind}+{scheme}" for kind in _OPTIONS for scheme in ("http", "https"))


@dataclass(frozen=True, slots=True)
class Address:
    """A server. `token` is never part of a text: `repr` leaves it out.

    base: "http://host:port" with a path, if there is one
    ca: certificates that sign the server's, in place of the system's
    also: folder of an embedded store that is kept beside
    """

    kind: str
    base: str
    org: str = ""
    bucket_prefix: str = ""
    ca: Path | None = None
    also: Path | None = None
    timeout_s: float = 10.0
    token: str = field(default="", repr=False)

    def bucket(self, name: str) -> str:
        """The bucket (InfluxDB 2) or database (1.x) for one of our names."""
        return self.bucket_prefix + name


def parse(url: str, environment: Mapping[str, str] = os.environ) -> Address:
    """The address of a URL; StoreError says what is wrong with it, without repeating a secret."""
    try:
        parts = urlsplit(url)
        query = parts.query.strip("&")
        options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query)))
        if parts.port == 0 or parts.fragment:
            raise ValueError
    except ValueError:
        raise StoreError(
            f"store {shown_address(url)}: host, port or options cannot be read; use one of {', '.join(SCHEMES)}"
        ) from None
    if parts.scheme not in SCHEMES:
        raise StoreError(f"store {parts.scheme}://…: use one of {', '.join(SCHEMES)}, or a folder")
    kind, scheme = parts.scheme.split("+")
    if parts.username or parts.password:
        raise StoreError(
            f"store {parts.scheme}://…@{parts.hostname}: no secrets in the URL; put them into {TOKEN} or {TOKEN_FILE}"
        )
    if not parts.hostname:
        raise StoreError(f"store {parts.scheme}://: names no host; write {parts.scheme}://host:8086")
    if options.keys() & {"token", "p", "password"}:
        raise StoreError(
            f"store {parts.scheme}://{parts.netloc}: no secrets in the URL; put the token into {TOKEN} or {TOKEN_FILE}"
        )
    if unknown := set(options) - _OPTIONS[kind]:
        raise StoreError(
            f"store {parts.scheme}://{parts.netloc}: unknown option {min(unknown)!r}; use {', '.join(sorted(_OPTIONS[kind]))}"
        )
    if kind == INFLUX2 and not options.get("org"):
        raise StoreError(f"store {parts.scheme}://{parts.netloc}: names no organisation; add ?org=…")
    try:
        timeout_s = float(options.get("timeout_s", "10"))
    except ValueError:
        timeout_s = 0.0
    if not 0.1 <= timeout_s <= 300:
        raise StoreError(f"store {parts.scheme}://{parts.netloc}: timeout_s={options['timeout_s']!r}; give 0.1 to 300")
    return Address(
        kind=kind,
        base=f"{scheme}://{parts.netloc}{parts.path.rstrip('/')}",
        org=options.get("org", ""),
        bucket_prefix=options.get("bucket_prefix", ""),
        ca=_existing(options.get("ca")),
        also=Path(options["also"]) if options.get("also") else None,
        timeout_s=timeout_s,
        token=_token(environment),
    )


def _existing(given: str | None) -> Path | None:
    if not given:
        return None
    if not Path(given).is_file():
        raise StoreError(f"ca={given}: there is no such file; name the certificate that signs the server's")
    return Path(given)


def _token(environment: Mapping[str, str]) -> str:
    if given := environment.get(TOKEN, ""):
        return given.strip()
    if not (file := environment.get(TOKEN_FILE, "")):
        return ""
    try:
        return Path(file).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise StoreError(f"{TOKEN_FILE}={file}: cannot be read: {error.strerror}") from error
