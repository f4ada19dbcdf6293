"""Rights to ask: each rule of docs/reference/api.md, by itself and on the application."""

import http.cookies
import time
from collections.abc import Iterator

import pytest

from cnctwin.api import guard
from cnctwin.api.access import COOKIE, SESSION_S, Access, Asking
from cnctwin.api.application import create_app
from cnctwin.api.failures import ADDRESSES_MAX, OF_ONE_MAX, WINDOW_S, Failures
from cnctwin.api.routes import page
from cnctwin.api.serve import ServeOptions, access_of
from cnctwin.api.sources import Sources
from cnctwin.errors import UsageError
from tests.cnctwin.api.small_plant import Client, client_of, small_plant

TOKEN = "a-token-of-more-than-sixteen"
OURS = {"host": "127.0.0.1:8080"}


def asking(
    method: str = "GET", path: str = "/machines", peer: str = "127.0.0.1", cookie: str | None = None, **headers: str
) -> Asking:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return Asking(method, path, peer, "http", {**OURS, **named}, cookie)


@pytest.fixture(scope="module")
def guarded() -> Iterator[Client]:
    with client_of(small_plant(), access=Access(TOKEN)) as client:
        yield client


# The Host header.


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost", "LOCALHOST:1", "[::1]:8080", "10.0.0.7:8080", "twin.shop", "Twin.Shop:80"]
)
def test_a_host_that_is_ours_is_answered(host: str) -> None:
    assert Access(hosts=frozenset({"twin.shop"})).judge(asking(host=host), 0.0).status == 0


@pytest.mark.parametrize(
    "host", ["", "evil.example", "127.0.0.1.evil.example", "localhost.evil.example:8080", "[::1", "0x7f.1", "twin.shop.evil"]
)
def test_a_name_that_is_not_ours_is_refused_however_it_resolves(host: str) -> None:
    verdict = Access(hosts=frozenset({"twin.shop"})).judge(asking(host=host), 0.0)
    assert verdict.status == 403
    assert "--allow-host" in verdict.line


def test_the_application_refuses_a_foreign_host_on_every_route() -> None:
    with client_of(small_plant(), host="evil.example") as client:
        for path in ("/", "/machines", "/livez", "/page/index.html", "/openapi.json"):
            assert client.get(path).status_code == 403, path


# Where a request comes from.


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:9999", "https://127.0.0.1:8080.evil.example", ""]
)
def test_what_changes_something_comes_from_our_own_page(origin: str) -> None:
    assert Access().judge(asking("POST", origin=origin), 0.0).status == 403


@pytest.mark.parametrize("origin", ["http://127.0.0.1:8080", "https://127.0.0.1:8080"])
def test_our_own_page_may(origin: str) -> None:
    assert Access().judge(asking("POST", origin=origin), 0.0).status == 0


def test_a_program_without_a_page_may_and_a_session_without_an_origin_may_not() -> None:
    assert Access().judge(asking("POST"), 0.0).status == 0
    access = Access(TOKEN)
    assert access.judge(asking("POST", cookie=access.session(0.0)), 1.0).status == 403
    assert access.judge(asking("POST", cookie=access.session(0.0), origin="http://127.0.0.1:8080"), 1.0).status == 0


@pytest.mark.parametrize(("site", "status"), [("same-origin", 0), ("none", 0), ("same-site", 403), ("cross-site", 403)])
def test_the_browser_s_own_word_counts_too(site: str, status: int) -> None:
    assert Access().judge(asking("POST", sec_fetch_site=site), 0.0).status == status


def test_a_page_of_another_site_may_link_to_us_but_not_hold_our_streams_open() -> None:
    assert Access().judge(asking(sec_fetch_site="cross-site", sec_fetch_mode="navigate"), 0.0).status == 0
    assert Access().judge(asking(path="/stream", sec_fetch_site="cross-site", sec_fetch_mode="cors"), 0.0).status == 403


def test_no_answer_lets_another_site_read_it() -> None:
    with client_of(small_plant()) as client:
        answer = client.get("/machines", headers={"Origin": "http://evil.example"})
    assert not any(name.startswith("access-control") for name in answer.headers)


# The token.


def test_without_the_token_there_is_the_page_and_nothing_of_the_plant(guarded: Client) -> None:
    for path in ("/", "/page/index.html", "/livez", "/readyz"):
        assert guarded.get(path).status_code in (200, 404), path
    for path in (
        "/machines",
        "/state/vmc",
        "/stream",
        "/health",
        "/metrics",
        "/openapi.json",
        "/docs",
        "/docs/index.html",
        "/routes",
        "/alerts",
        "/gap/vmc/report",
        "/nothing",
    ):
        refusal = guarded.get(path)
        assert (refusal.status_code, list(refusal.json())) == (401, ["error"]), path
        assert refusal.headers["www-authenticate"] == "Bearer"


def test_the_bearer_of_the_token_is_let_in(guarded: Client) -> None:
    assert guarded.get("/machines", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200
    assert guarded.get("/machines", headers={"Authorization": f"bearer {TOKEN}"}).status_code == 200


@pytest.mark.parametrize(
    "header", ["Bearer", "Bearer ", f"Basic {TOKEN}", f"Bearer {TOKEN}x", f"Bearer {TOKEN[:-1]}", "Bearer é", "Bearer \x00"]
)
def test_another_token_is_not(header: str) -> None:
    verdict = Access(TOKEN).judge(asking(authorization=header), 0.0)
    assert (verdict.status, verdict.is_wrong_token) == (401, True)
    assert TOKEN not in verdict.line


def test_the_token_is_no_part_of_an_address(guarded: Client) -> None:
    for name in ("token", "access_token", "key"):
        assert guarded.get(f"/machines?{name}={TOKEN}").status_code == 401


def test_the_token_is_compared_in_constant_time_and_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[bytes, bytes]] = []
    monkeypatch.setattr("cnctwin.api.access.hmac.compare_digest", lambda a, b: compared.append((a, b)) or a == b)
    access = Access(TOKEN)
    assert access.is_token(TOKEN)
    assert not access.is_token("")
    assert [len(part) for pair in compared for part in pair] == [32] * 4  # digests: not even the length can be told
    assert TOKEN not in repr(access)


def test_a_log_in_sets_a_cookie_that_no_script_and_no_other_site_can_use(guarded: Client) -> None:
    answer = guarded.post("/login", json={"token": TOKEN})
    assert answer.status_code == 204
    morsel = http.cookies.SimpleCookie(answer.headers["set-cookie"])[COOKIE]
    assert (morsel["httponly"], morsel["samesite"], morsel["path"], morsel["max-age"]) == (True, "strict", "/", str(SESSION_S))
    assert not morsel["secure"]  # plain http; see below
    assert TOKEN not in answer.headers["set-cookie"]
    assert guarded.get("/machines").status_code == 200
    guarded.post("/logout", headers={"Origin": "http://127.0.0.1"})
    assert guarded.get("/machines").status_code == 401


def test_over_tls_the_cookie_stays_on_tls() -> None:
    with client_of(access=Access(TOKEN), scheme="https") as client:
        assert "Secure" in client.post("/login", json={"token": TOKEN}).headers["set-cookie"]
    proxied = Access(TOKEN, proxy_header="X-User", proxy="10.0.0.5")
    for peer, is_secure in (("10.0.0.5", True), ("10.0.0.6", False)):
        with client_of(access=proxied, peer=peer) as client:
            answer = client.post("/login", json={"token": TOKEN}, headers={"X-Forwarded-Proto": "https"})
            assert ("Secure" in answer.headers["set-cookie"]) is is_secure


def test_a_session_ends_and_cannot_be_made_longer_or_made_up() -> None:
    access, now_s = Access(TOKEN), time.time()
    session = access.session(now_s)
    assert access.judge(asking(cookie=session), now_s + SESSION_S - 1).status == 0
    assert access.judge(asking(cookie=session), now_s + SESSION_S).status == 401
    until, _, proof = session.partition(".")
    for forged in (
        f"{int(until) + 1}.{proof}",
        f"{until}.",
        until,
        "",
        ".",
        f"-1.{proof}",
        f"{'9' * 40}.{proof}",
        f"{until}.é",
        f"٣.{proof}",
    ):
        assert access.judge(asking(cookie=forged), now_s).status == 401, forged
    assert Access(f"{TOKEN}2").judge(asking(cookie=session), now_s).status == 401


def test_the_right_token_is_let_in_however_many_wrong_ones_came_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "DELAY_S", 0.0)
    monkeypatch.setattr(page, "DELAY_S", 0.0)
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    app = create_app(Sources(small_plant(), access=Access(TOKEN)))
    with Client(app, "10.0.0.9", "127.0.0.1") as guesser, Client(app, "10.0.0.8", "127.0.0.1") as other:
        told = [guesser.post("/login", json={"token": f"wrong token {n:04}"}) for n in range(25)]
        told += [guesser.get("/machines", headers={"Authorization": f"Bearer wrong{n:04}"}) for n in range(25)]
        assert [one.status_code for one in told] == [401] * OF_ONE_MAX + [429] * (50 - OF_ONE_MAX)
        assert all(0 < int(one.headers["retry-after"]) <= WINDOW_S for one in told[OF_ONE_MAX:])
        assert guesser.get("/machines", headers=bearer).status_code == 200
        assert guesser.post("/login", json={"token": TOKEN}).status_code == 204
        assert other.post("/login", json={"token": "wrong" * 5}).status_code == 401, "only the one who guesses waits"
        assert other.get("/machines", headers=bearer).status_code == 200


def test_who_guesses_waits_a_minute_and_the_addresses_that_are_remembered_are_bounded() -> None:
    failures = Failures()
    assert [failures.add("10.0.0.1", number) for number in range(OF_ONE_MAX)] == [0.0] * OF_ONE_MAX
    assert failures.add("10.0.0.1", 10.0) == WINDOW_S - 10.0
    assert failures.add("10.0.0.1", WINDOW_S) == 0.0, "a try that had to wait does not make the wait longer"
    for number in range(ADDRESSES_MAX + 10):
        assert failures.add(f"address {number}", 5.0) == 0.0
    assert len(failures._by_address) == ADDRESSES_MAX


@pytest.mark.parametrize("body", [f'{{"tokn": "{TOKEN}"}}', f'{{"token": ["{TOKEN}"]}}', f'"{TOKEN}"', TOKEN, ""])
def test_a_token_in_the_wrong_place_is_not_repeated(body: str, caplog: pytest.LogCaptureFixture) -> None:
    with client_of(access=Access(TOKEN)) as client:
        refusal = client.post("/login", content=body, headers={"Content-Type": "application/json"})
    assert refusal.status_code == 400
    assert TOKEN not in refusal.text
    assert TOKEN not in caplog.text


# The reverse proxy.

PROXIED = Access(proxy_header="X-Remote-User", proxy="10.0.0.5")


def test_whom_the_proxy_names_is_let_in_and_nobody_else() -> None:
    ada = asking(peer="10.0.0.5", x_remote_user="ada", host="twin.shop.example")
    assert (PROXIED.judge(ada, 0.0).status, PROXIED.judge(ada, 0.0).user) == (0, "ada")
    assert PROXIED.judge(ada._replace(peer="::ffff:10.0.0.5"), 0.0).status == 0
    assert PROXIED.judge(asking(peer="10.0.0.5"), 0.0).status == 401
    for peer in ("10.0.0.6", "127.0.0.1", "", "10.0.0.55"):
        assert PROXIED.judge(asking(peer=peer, x_remote_user="ada"), 0.0).status == 401, peer


def test_the_address_that_asks_is_that_of_the_connection_whatever_a_header_says() -> None:
    assert PROXIED.judge(asking(peer="10.0.0.6", x_remote_user="ada", x_forwarded_for="10.0.0.5"), 0.0).status == 401


def test_behind_the_proxy_its_own_word_says_whom_a_limit_is_for_and_nobody_else_s() -> None:
    forged = asking(peer="10.0.0.5", x_forwarded_for="1.1.1.1, 2001:db8::7:1")
    assert PROXIED.client(forged) == "2001:db8::/64", "the last entry is the proxy's own"
    assert PROXIED.client(forged._replace(peer="10.0.0.6")) == "10.0.0.6"
    for stated in ("", "unknown", "1.1.1.1, evil"):
        assert PROXIED.client(asking(peer="10.0.0.5", x_forwarded_for=stated)) == "10.0.0.5"


def test_behind_the_proxy_who_guesses_waits_and_not_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "DELAY_S", 0.0)
    access = Access(TOKEN, proxy_header="X-Remote-User", proxy="10.0.0.5")
    with client_of(access=access, peer="10.0.0.5") as client:
        for last, statuses in (("1", [401] * OF_ONE_MAX + [429]), ("2", [401])):
            stated = {"X-Forwarded-For": f"10.1.1.{last}"}
            told = [client.post("/login", json={"token": "wrong" * 5}, headers=stated).status_code for _ in statuses]
            assert told == statuses


# What the command lets be.


def test_loopback_needs_nothing_and_any_other_address_a_token_or_a_proxy(tmp_path_factory: pytest.TempPathFactory) -> None:
    assert access_of(ServeOptions(), None).token is None
    for host in ("0.0.0.0", "::", "192.168.1.7", "twin.shop"):
        with pytest.raises(UsageError, match="open to the network"):
            access_of(ServeOptions(host=host), None)
        assert access_of(ServeOptions(host=host), TOKEN).token == TOKEN
        assert access_of(ServeOptions(host=host, proxy_header="X-User", proxy="10.0.0.5"), None).proxy == "10.0.0.5"
    file = tmp_path_factory.mktemp("token") / "token"
    file.write_text(f"{TOKEN}\n")
    file.chmod(0o644)
    with pytest.raises(UsageError, match="mode 644; chmod 600"):
        access_of(ServeOptions(token_file=file), None)
    file.chmod(0o600)
    assert access_of(ServeOptions(token_file=file), "another-token-of-the-environment").token == TOKEN


@pytest.mark.parametrize(
    ("options", "token", "line"),
    [
        (ServeOptions(), "short", "CNCTWIN_PAGE_TOKEN is shorter than 16"),
        (ServeOptions(), "", "CNCTWIN_PAGE_TOKEN is shorter than 16"),
        (ServeOptions(proxy_header="X-User"), None, "go together"),
        (ServeOptions(proxy="10.0.0.5"), None, "go together"),
        (ServeOptions(proxy_header="X-User", proxy="proxy.shop"), None, "proxy.shop is no address"),
    ],
)  # fmt: skip
def test_what_would_not_hold_is_refused_at_the_start(options: ServeOptions, token: str | None, line: str) -> None:
    with pytest.raises(UsageError, match=line) as refused:
        access_of(options, token)
    assert not token or f" {token} " not in str(refused.value)


# What a browser is told.


def test_every_answer_has_the_security_headers(guarded: Client) -> None:
    for path in ("/", "/machines", "/nothing", "/login"):
        headers = guarded.get(path, headers={"Authorization": f"Bearer {TOKEN}"}).headers
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'self';")
        assert "unsafe" not in policy
        assert (headers["x-content-type-options"], headers["x-frame-options"]) == ("nosniff", "DENY")
        assert (headers["referrer-policy"], headers["cross-origin-resource-policy"]) == ("no-referrer", "same-origin")
        assert headers["cache-control"] in ("no-store", "no-cache")
        assert "server" not in headers
