"""The rights of each role: stated for every route, and held by the application."""

import pytest

from cnctwin.api.access import Access
from cnctwin.api.door.role import SAFE_METHODS, Role, right_of, stated_rights
from cnctwin.api.door.users import User
from cnctwin.api.i3x.problem import PREFIX as I3X
from tests.cnctwin.api.small_plant import Client, client_of, small_plant

TOKENS = {role: f"the token of the {role.title}" for role in Role}
USERS = tuple(User(role.title[:4], role, TOKENS[role]) for role in Role)
ORIGIN = {"Origin": "http://127.0.0.1"}


def bearer(role: Role) -> dict[str, str]:
    return {"Authorization": f"Bearer {TOKENS[role]}"}


def asked(client: Client, method: str, path: str, role: Role) -> tuple[int, str]:
    answer = client.request(method, path, headers=bearer(role), json={} if method == "POST" else None)
    return answer.status_code, answer.json().get("error", "") if isinstance(answer.json(), dict) else ""


def test_every_route_that_may_change_something_has_a_stated_right() -> None:
    """A new route takes an administrator until somebody says who else may."""
    with client_of(small_plant()) as client:
        documents = {prefix: client.get(f"{prefix}/openapi.json").json() for prefix in ("", I3X)}
    routes = {
        (method.upper(), prefix + path.replace("{fingerprint}", "x").replace("{job_id}", "x"))
        for prefix, document in documents.items()
        for path, methods in document["paths"].items()
        for method in methods
        if method.upper() not in SAFE_METHODS
    }
    assert ("PUT", f"{I3X}/objects/value") in routes
    stated = {method for method, _ in stated_rights()}
    assert stated <= {"POST", "GET", "PUT"}
    for method, path in routes:
        assert right_of(method, path).object != path, f"{method} {path} has no entry in door/role.py"


@pytest.mark.parametrize(
    ("method", "path", "least"),
    [
        ("GET", "/machines", Role.READER),
        ("GET", "/alerts", Role.READER),
        ("POST", "/predict", Role.READER),
        ("POST", "/twin/replay", Role.READER),
        ("POST", "/alerts/ea33a6/acknowledge", Role.OPERATOR),
        ("POST", "/jobs", Role.OPERATOR),
        ("POST", "/jobs/night-7/cancel", Role.OPERATOR),
        ("POST", "/twin/vmc/promote", Role.OPERATOR),
        ("POST", "/twin/vmc/back", Role.OPERATOR),
        ("POST", "/demo/reveal", Role.OPERATOR),
        ("GET", "/audit", Role.ADMINISTRATOR),
        ("DELETE", "/machines", Role.ADMINISTRATOR),
    ],
)
def test_a_role_may_what_it_may_and_is_told_what_it_takes(method: str, path: str, least: Role) -> None:
    with client_of(small_plant(), access=Access(users=USERS)) as client:
        for role in Role:
            status, line = asked(client, method, path, role)
            assert (status == 403) is (role < least), (role, status, line)
            if role < least:
                assert (
                    line
                    == f"{role.title[:4]} is {'a' if role is Role.READER else 'an'} {role.title}; this takes {article(least)}"
                )


def article(role: Role) -> str:
    return f"{'a' if role is Role.READER else 'an'} {role.title}"


def test_the_one_token_and_loopback_may_everything_as_before() -> None:
    for access, headers in ((Access(), {}), (Access(TOKENS[Role.READER]), bearer(Role.READER))):
        with client_of(small_plant(), access=access) as client:
            assert client.get("/audit", headers=headers).status_code == 200
            assert client.get("/whoami", headers=headers).json()["role"] == "administrator"


def test_who_asks_is_told_name_and_role() -> None:
    with client_of(small_plant(), access=Access(users=USERS)) as client:
        assert client.get("/whoami").status_code == 401
        for role in Role:
            told = client.get("/whoami", headers=bearer(role)).json()
            assert told == {"user": role.title[:4], "role": role.title, "logs_out": True}


def test_a_session_has_the_role_of_the_token_that_began_it_and_no_other() -> None:
    access = Access(users=USERS)
    with client_of(small_plant(), access=access) as client:
        assert client.post("/login", json={"token": TOKENS[Role.READER]}).status_code == 204
        assert client.get("/whoami").json()["user"] == "read"
        assert client.post("/jobs", json={"job": "count"}, headers=ORIGIN).status_code == 403
    reader, _, administrator = USERS
    until, proof, name = access.session(1000.0, reader).split(".", 2)
    assert name == "read"
    forged = f"{until}.{proof}.{administrator.name}"
    with client_of(small_plant(), access=access) as client:
        client.cookies.set("cnctwin_session", forged)
        assert client.get("/whoami").status_code == 401


def test_behind_a_proxy_its_users_have_the_roles_of_the_file_and_strangers_look_only() -> None:
    users = (User("ada", Role.OPERATOR), User("grace", Role.ADMINISTRATOR))
    access = Access(proxy_header="X-Remote-User", proxy="10.0.0.5", users=users)
    with client_of(small_plant(), access=access, peer="10.0.0.5") as client:
        roles = [client.get("/whoami", headers={"X-Remote-User": name}).json()["role"] for name in ("ada", "grace", "mallory")]
        assert roles == ["operator", "administrator", "reader"]
    with client_of(small_plant(), access=access, peer="10.0.0.6") as client:
        assert client.get("/whoami", headers={"X-Remote-User": "grace"}).status_code == 401
    without_a_file = Access(proxy_header="X-Remote-User", proxy="10.0.0.5")
    with client_of(small_plant(), access=without_a_file, peer="10.0.0.5") as client:
        assert client.get("/whoami", headers={"X-Remote-User": "ada"}).json()["role"] == "administrator"
