"""The address of a broker, and the credentials for it."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from sparkplug.errors import BrokerAddressError
from sparkplug.shown_address import shown_address

_PORTS = {"mqtt": 1883, "mqtts": 8883}
_VERSIONS = {"3.1.1": 4, "5": 5}
_OPTIONS = frozenset({"version"})
_FILES = ("ca_file", "certificate_file", "key_file")


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """One MQTT broker. The password never appears in `repr`, `url` or a log.

    >>> BrokerAddress.from_url("mqtts://edge-1@broker.plant.example").url
    'mqtts://edge-1@broker.plant.example:8883'
    """

    host: str = "127.0.0.1"
    port: int = 1883
    tls: bool = False
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    ca_file: Path | None = None
    certificate_file: Path | None = None
    key_file: Path | None = None
    mqtt_version: int = 4  # 4 is MQTT 3.1.1, 5 is MQTT 5

    @classmethod
    def from_url(cls, text: str) -> "BrokerAddress":
        """Read `mqtt://[user@]host[:port][?option=value&…]` or `mqtts://…`; raises BrokerAddressError.

        Options: `version` (3.1.1 or 5), and for TLS `ca_file`, `certificate_file`, `key_file` (without: the system's
        authorities, no client certificate). A password is refused here, since an address is shown and logged; give it with
        `with_password`.
        """
        shown = shown_address(text, _OPTIONS.union(_FILES))
        try:
            parts = urlsplit(text)
            port = parts.port
            options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
        except ValueError:  # whose text repeats what it cannot read, and that may be a password
            raise BrokerAddressError(
                f"broker address {shown!r}: host, port or options cannot be read; write mqtt://[user@]host[:port][?option=value]"
            ) from None
        if parts.password is not None or "password" in options:
            raise BrokerAddressError("a broker address must hold no password; put it into an environment variable or a file")
        if parts.scheme not in _PORTS or not parts.hostname or parts.path.strip("/") or parts.fragment:
            raise BrokerAddressError(f"broker address {shown!r} is not mqtt://[user@]host[:port] or mqtts://[user@]host[:port]")
        tls = parts.scheme == "mqtts"
        unknown = options.keys() - (_OPTIONS.union(_FILES) if tls else _OPTIONS)
        if unknown or options.get("version", "5") not in _VERSIONS:
            allowed = "version=3.1.1 or version=5" + (", ca_file, certificate_file, key_file" if tls else "; files need mqtts://")
            raise BrokerAddressError(f"broker address {shown!r}: what stands behind the ? is not of {allowed}")
        ca_file, certificate_file, key_file = (Path(options[name]) if name in options else None for name in _FILES)
        username = None if parts.username is None else unquote(parts.username)
        version = _VERSIONS[options.get("version", "3.1.1")]
        host, port = parts.hostname, port or _PORTS[parts.scheme]
        return cls(host, port, tls, username, None, ca_file, certificate_file, key_file, version)

    def with_password(self, password: str | None) -> "BrokerAddress":
        """The same address with a password."""
        return replace(self, password=password)

    @property
    def url(self) -> str:
        """The address without its secret."""
        user = "" if self.username is None else f"{quote(self.username, safe='')}@"
        host = f"[{self.host}]" if ":" in self.host else self.host
        options = {name: str(path) for name in _FILES if (path := getattr(self, name)) is not None}
        if self.mqtt_version == 5:
            options["version"] = "5"
        query = f"?{urlencode(options, safe='/')}" if options else ""
        return f"mqtt{'s' if self.tls else ''}://{user}{host}:{self.port}{query}"
