"""Where a broker is and how to get in."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from sparkplug.errors import BrokerAddressError

_PORTS = {"mqtt": 1883, "mqtts": 8883}


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

    @classmethod
    def from_url(cls, text: str) -> "BrokerAddress":
        """Read `mqtt://[user@]host[:port]` or `mqtts://…`; raises BrokerAddressError.

        A password is refused here, since an address is shown and logged; give it with `with_password`.
        """
        try:
            parts = urlsplit(text)
            port = parts.port
        except ValueError as error:
            raise BrokerAddressError(f"broker address {text!r}: {error}") from error
        if parts.scheme not in _PORTS or not parts.hostname or parts.path.strip("/") or parts.query:
            raise BrokerAddressError(f"broker address {text!r} is not mqtt://[user@]host[:port] or mqtts://[user@]host[:port]")
        if parts.password is not None:
            raise BrokerAddressError("a broker address must hold no password; put it into an environment variable or a file")
        username = None if parts.username is None else unquote(parts.username)
        return cls(parts.hostname, port or _PORTS[parts.scheme], parts.scheme == "mqtts", username)

    def with_password(self, password: str | None) -> "BrokerAddress":
        """The same address with a password."""
        return replace(self, password=password)

    @property
    def url(self) -> str:
        """The address without its secret."""
        user = "" if self.username is None else f"{quote(self.username, safe='')}@"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"mqtt{'s' if self.tls else ''}://{user}{host}:{self.port}"
