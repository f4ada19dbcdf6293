"""Access to the interface: decided from the address that asks, the headers, and the options of the server. No I/O, no clock.

* On loopback, without a token, whoever is on this machine may.
* With a token, who has it: as `Authorization: Bearer …`, or as the cookie that a log-in sets. Never in an address.
* Behind a reverse proxy, whom the proxy names in the header that was named, and only in requests that come from its address.

Each has a role (door/role.py): that of the file of users, else, where there is no such file, an administrator's.

Beside that the Host header has to name this server (a page of somebody else's that has its name resolved to us would have its
own), and what changes something has to come from a page of ours, or from no page.
"""

import hashlib
import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from cnctwin.api.door.role import SAFE_METHODS, Role, right_of
from cnctwin.api.door.users import User
from cnctwin.api.i3x.problem import PREFIX as I3X

COOKIE = "cnctwin_session"
SESSION_S = 12 * 3600
LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})
OPEN_PATHS = frozenset({"/", "/livez", "/readyz", "/login", f"{I3X}/info"})
"""None of them says anything of the plant: the page asks for the token, and i3X has its /info answered before."""
OPEN_FOLDER = "/page/"


class Asking(NamedTuple):
    """The facts that access is decided by. `headers` have lower-case names."""

    method: str
    path: str
    peer: str
    scheme: str
    headers: Mapping[str, str]
    cookie: str | None = None


class Verdict(NamedTuple):
    """`status` 0 is yes; else the refusal. `user` is a name of the file of users, or one that the proxy gave."""

    status: int
    line: str = ""
    user: str | None = None
    role: Role | None = None
    is_wrong_token: bool = False


@dataclass(frozen=True, slots=True)
class Access:
    """The rules as the server was started with. The token appears in no `repr`.

    proxy_header, proxy: the reverse proxy's header with the user, and the address that it asks from
    hosts: more names that the Host header may have (behind the proxy any name will do: that is the proxy's to check)
    users: those of the file, if any
    """

    token: str | None = field(default=None, repr=False)
    proxy_header: str | None = None
    proxy: str | None = None
    hosts: frozenset[str] = frozenset()
    users: tuple[User, ...] = ()

    def judge(self, asking: Asking, now_s: float) -> Verdict:
        """Decide whether this may be answered, by who asks and by the role that it takes."""
        by_proxy = self.is_proxy(asking.peer)
        host = asking.headers.get("host", "")
        if not by_proxy and not self._is_ours(host):
            return Verdict(
                403, f"Host {host[:80]!r} is not a name of this server; ask for its address, or start it with --allow-host"
            )
        if (line := _foreign(asking, host)) is not None:
            return Verdict(403, line)
        if asking.path in OPEN_PATHS or asking.path.startswith(OPEN_FOLDER):
            return Verdict(0)
        verdict = self._known(asking, now_s, by_proxy=by_proxy)
        needed = right_of(asking.method, asking.path).role
        if verdict.role is not None and verdict.role < needed:
            line = f"{verdict.user or 'this token'} is {_article(verdict.role)}; this takes {_article(needed)}"
            return verdict._replace(status=403, line=line)
        return verdict

    @property
    def has_tokens(self) -> bool:
        """True if somebody can log in."""
        return any(user.token is not None for user in self._bearers())

    def is_proxy(self, peer: str) -> bool:
        """Return True if this is the address of the proxy."""
        return self.proxy is not None and same_address(peer, self.proxy)

    def client(self, asking: Asking) -> str:
        """Return who is counted for a request: its sender, or the one that the proxy, and only the proxy, names as its own."""
        if not self.is_proxy(asking.peer):
            return sender(asking.peer)
        stated = asking.headers.get("x-forwarded-for", "").rpartition(",")[2].strip()
        return sender(stated) if _is_literal(stated) else sender(asking.peer)

    def session(self, now_s: float, user: User | None = None) -> str:
        """Return the cookie that a log-in sets: until when, a proof that takes the token to make, and whose it is."""
        until_s = int(now_s) + SESSION_S
        bearer = user or User("", Role.ADMINISTRATOR, self.token)
        return f"{until_s}.{_proof(bearer, until_s)}" + (f".{bearer.name}" if bearer.name else "")

    def bearer(self, given: str) -> User | None:
        """Return whose token this is, in a time that does not tell how much of it is right."""
        digest, found = _digest(given), None
        for user in self._bearers():
            if user.token is not None and hmac.compare_digest(digest, _digest(user.token)):
                found = user
        return found

    def is_token(self, given: str) -> bool:
        """Return True if this is a token of the server."""
        return self.bearer(given) is not None

    def _bearers(self) -> tuple[User, ...]:
        return self.users if self.token is None else (User("", Role.ADMINISTRATOR, self.token), *self.users)

    def _role_of(self, name: str) -> Role:
        """The role of whom the proxy names: that of the file; without a file everybody may do everything."""
        unknown = Role.READER if self.users else Role.ADMINISTRATOR
        return next((user.role for user in self.users if user.name == name), unknown)

    def _known(self, asking: Asking, now_s: float, *, by_proxy: bool) -> Verdict:
        given = asking.headers.get("authorization", "")
        if by_proxy and self.proxy_header is not None and (user := asking.headers.get(self.proxy_header.lower(), "").strip()):
            return Verdict(0, user=user[:100], role=self._role_of(user))
        if self.has_tokens:
            if given:
                scheme, _, token = given.partition(" ")
                if scheme.lower() == "bearer" and (bearer := self.bearer(token.strip())) is not None:
                    return Verdict(0, user=bearer.name or None, role=bearer.role)
                return Verdict(401, "Authorization is not Bearer with the token of this server", is_wrong_token=True)
            if asking.cookie is not None and (bearer := self._of_session(asking.cookie, now_s)) is not None:
                return Verdict(0, user=bearer.name or None, role=bearer.role)
            return Verdict(401, "no token: log in at /login, or send Authorization: Bearer …")
        if self.proxy_header is not None:
            who = "the proxy names no user" if by_proxy else "this server is asked through its proxy only"
            return Verdict(401, f"{who}: header {self.proxy_header}, from the proxy's address")
        return Verdict(0, role=Role.ADMINISTRATOR)

    def _is_ours(self, host: str) -> bool:
        name = host_name(host)
        return name in LOCAL_NAMES or name in self.hosts or _is_literal(name)

    def _of_session(self, cookie: str, now_s: float) -> User | None:
        until, _, rest = cookie.partition(".")
        proof, _, name = rest.partition(".")
        user = next((one for one in self._bearers() if one.name == name and one.token is not None), None)
        if user is None or not (until.isascii() and until.isdigit() and len(until) <= 12) or now_s >= int(until):
            return None
        return user if hmac.compare_digest(proof.encode("utf-8", "replace"), _proof(user, int(until)).encode()) else None


def _proof(user: User, until_s: int) -> str:
    return hmac.new(_digest(user.token or ""), f"session {until_s} {user.name}".rstrip().encode(), hashlib.sha256).hexdigest()


def _article(role: Role) -> str:
    return f"{'a' if role is Role.READER else 'an'} {role.title}"


def host_name(host: str) -> str:
    """The name in a Host header, without its port, in lower case.

    >>> host_name("Twin.shop.example:8080"), host_name("[::1]:8080"), host_name("127.0.0.1")
    ('twin.shop.example', '[::1]', '127.0.0.1')
    """
    name = host.strip().lower()
    if name.startswith("["):
        return name[: name.find("]") + 1]
    return name.rpartition(":")[0] if ":" in name else name


def same_address(one: str, other: str) -> bool:
    """Return True if two addresses are one, an IPv4 one that is written as IPv6 included."""
    try:
        return _address(one) == _address(other)
    except ValueError:
        return False


def sender(address: str) -> str:
    """The name under which an address is counted: with IPv6 a network of 64 bits, of which anybody has a whole one.

    >>> sender("::ffff:10.0.0.5"), sender("2001:db8::1:2")
    ('10.0.0.5', '2001:db8::/64')
    """
    try:
        found = _address(address)
    except ValueError:
        return address[:64]
    return str(found) if found.version == 4 or found.is_loopback else str(ipaddress.ip_network((found, 64), strict=False))


def is_loopback(address: str) -> bool:
    """Return True if only this machine reaches an address.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, True, False)
    """
    try:
        return _address(address).is_loopback
    except ValueError:
        return address == "localhost"


def _foreign(asking: Asking, host: str) -> str | None:
    """Why a request comes from a page that is not ours; None where it does not."""
    site = asking.headers.get("sec-fetch-site", "none")
    origin = asking.headers.get("origin")
    if asking.method in SAFE_METHODS:
        # A page elsewhere may link to us; it may not have its visitors' browsers hold our streams open.
        navigates = asking.headers.get("sec-fetch-mode", "navigate") == "navigate"
        return None if site != "cross-site" or navigates else "this comes from a page of another site"
    if origin is not None and origin.lower() not in (f"http://{host}".lower(), f"https://{host}".lower()):
        return f"Origin {origin[:80]!r} is not that of this server; only its own pages may change something"
    if site not in ("none", "same-origin"):
        return "this comes from a page of another site; only this server's own pages may change something"
    if origin is None and asking.cookie is not None:
        return "a session needs the header Origin to change something; a program sends Authorization: Bearer …"
    return None


def _is_literal(name: str) -> bool:
    try:
        _address(name.strip("[]"))
    except ValueError:
        return False
    return True


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    found = ipaddress.ip_address(text)
    return found.ipv4_mapped or found if isinstance(found, ipaddress.IPv6Address) else found


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()
