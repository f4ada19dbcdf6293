"""The registry over HTTP: listed for all, promoted by administrators."""

from pathlib import Path

from cnctwin.api.access import Access
from cnctwin.api.door.role import Role
from cnctwin.api.door.users import User
from cnctwin.models import registry
from tests.cnctwin.api.small_plant import client_of, small_plant
from tests.cnctwin.models.made_model import made_model

OPERATOR, ADMINISTRATOR = "the-token-of-an-operator", "the-token-of-an-administrator"
ACCESS = Access(users=(User("ada", Role.OPERATOR, OPERATOR), User("grace", Role.ADMINISTRATOR, ADMINISTRATOR)))
PATH = "/models/residual/vmc/promote"


def test_an_administrator_lets_a_version_count_and_an_operator_does_not(tmp_path: Path) -> None:
    place = tmp_path / "models"
    first, second = (registry.add(place, "residual", "vmc", made_model(tmp_path / str(seed), seed), 0.0) for seed in (1, 2))
    with client_of(small_plant(), access=ACCESS, registry=place) as client:
        as_operator, as_administrator = ({"Authorization": f"Bearer {token}"} for token in (OPERATOR, ADMINISTRATOR))
        body = {"version": second[:12], "because": "won its comparison"}
        refused = client.post(PATH, json=body, headers=as_operator)
        assert (refused.status_code, refused.json()["error"]) == (403, "ada is an operator; this takes an administrator")
        (shelf,) = client.get("/models", headers=as_operator).json()
        assert (shelf["champion"], set(shelf["versions"])) == (first, {first, second})
        told = client.post(PATH, json=body, headers=as_administrator)
        assert told.status_code == 200, told.text
        assert (told.json()["champion"], told.json()["previous"]) == (second, first)
        assert told.json()["reason"] == "won its comparison (by grace)"
        for path, wrong, status in (
            (PATH, body, 409),
            (PATH, {"version": "none", "because": "x"}, 409),
            (PATH, {"version": second}, 400),
            ("/models/residual/..%2F..%2Fetc/promote", body, 404),
            ("/models/.hidden/vmc/promote", body, 409),
        ):
            answer = client.post(path, json=wrong, headers=as_administrator)
            assert (answer.status_code, list(answer.json())) == (status, ["error"]), (path, wrong, answer.text)
        deeds = client.get("/audit", headers=as_administrator).json()["deeds"]
    assert (deeds[-1]["user"], deeds[-1]["outcome"][:3], deeds[-2]["user"], deeds[-2]["outcome"]) == (
        "ada",
        "403",
        "grace",
        "done",
    )
    assert deeds[-2]["object"] == f"residual/vmc {second[:12]}"


def test_without_a_registry_it_says_what_to_give() -> None:
    with client_of(small_plant()) as client:
        assert "--registry" in client.get("/models").json()["error"]
