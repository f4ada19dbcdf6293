"""The export beside what was recorded from a real MLflow server (3.17.2, `mlflow server` on SQLite)."""

import json
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

import httpx
import pytest

from cnctwin.errors import UsageError
from cnctwin.models import registry
from cnctwin.models.mlflow_export import export
from tests.cnctwin.models.made_model import made_model

RECORDED = Path(__file__).with_name("mlflow_3_17.json")
NOW_S = 1_795_000_000.0


def recorded() -> list[dict[str, Any]]:
    """First and second export of one version."""
    text = RECORDED.read_text().replace("cnctwin 0.1.0", f"cnctwin {version_of('cnctwin')}")
    return list(json.loads(text)["exchanges"])


def exported(tmp_path: Path, transport: httpx.BaseTransport, at_ms: int = 1_795_000_000_000) -> dict[str, Any]:
    if not (tmp_path / "m").exists():
        registry.add(tmp_path / "models", "residual", "vmc", made_model(tmp_path / "m"), NOW_S)
    own = registry.shelf(tmp_path / "models", "residual", "vmc")
    (version,) = own.versions()
    return export(own.card(version), own.folder / version, "http://mlflow.shop/", at_ms, transport)


def test_it_sends_what_a_real_server_took_and_reads_what_it_answered(tmp_path: Path) -> None:
    waiting = recorded()

    def answer(request: httpx.Request) -> httpx.Response:
        exchange = waiting.pop(0)
        told = exchange["request"]
        assert (request.method, request.url.raw_path.decode()) == (told["method"], told["path"])
        assert (json.loads(request.content) if request.content else None) == told["body"]
        return httpx.Response(exchange["response"]["status"], json=exchange["response"]["body"])

    first = exported(tmp_path, httpx.MockTransport(answer))
    assert first["artifacts"] == ["manifest.json", "card.json"]
    assert len(waiting) == 7  # of 15: the experiment is made once
    second = exported(tmp_path, httpx.MockTransport(answer), 1_795_000_000_001)
    assert not waiting
    assert first["experiment_id"] == second["experiment_id"] and first["run_id"] != second["run_id"]


def test_a_server_that_keeps_artifacts_elsewhere_is_told_of(tmp_path: Path) -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        assert "mlflow-artifacts" not in request.url.path
        if request.url.path.endswith("get-by-name"):
            return httpx.Response(200, json={"experiment": {"experiment_id": "7"}})
        return httpx.Response(200, json={"run": {"info": {"run_id": "r", "artifact_uri": "s3://bucket/7/r"}}})

    told = exported(tmp_path, httpx.MockTransport(answer))
    assert told["artifacts"] == "not uploaded: the server keeps artifacts at s3, and takes none over HTTP"


def refusing(_request: httpx.Request) -> httpx.Response:
    return httpx.Response(401, text="no\nentry")


def unreachable(request: httpx.Request) -> httpx.Response:
    raise httpx.ConnectError("refused", request=request)


def page(_request: httpx.Request) -> httpx.Response:
    return httpx.Response(200, text="<html>")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (refusing, "MLflow refused /api/2.0/mlflow/experiments/get-by-name: 401 no entry"),
        (unreachable, "refused; does it run?"),
        (page, "is mlflow.shop an MLflow server?"),
    ],
)
def test_what_goes_wrong_is_one_line(answer: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as raised:
        exported(tmp_path, httpx.MockTransport(answer))
    assert said in str(raised.value) and "\n" not in str(raised.value)
