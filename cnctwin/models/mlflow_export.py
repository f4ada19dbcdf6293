"""A version as a run of MLflow, through its REST API 2.0; nothing of MLflow is installed for it.

experiments/get-by-name, experiments/create, runs/create, runs/log-batch, runs/update; manifest and card as artifacts where the
server takes them (`mlflow-artifacts:`, what `mlflow server` serves by default); else it is said that it does not.
"""

import json
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote, urlsplit

import httpx

from cnctwin.errors import UsageError
from cnctwin.models.card import CARD, MANIFEST, Card
from sparkplug.shown_address import shown_address

API = "/api/2.0/mlflow"
ARTIFACTS = "/api/2.0/mlflow-artifacts/artifacts"
BATCH_MAX = 100
"""Parameters or tags in one request, as the server's limit is."""
METRICS_MAX = 500
TEXT_MAX = 500
TIMEOUT_S = 20.0
ANSWER_BYTES_MAX = 1024 * 1024


def export(card: Card, folder: Path, url: str, at_ms: int, transport: httpx.BaseTransport | None = None) -> dict[str, Any]:
    """Make the run; its ids, and what became of the artifacts. Raises UsageError naming the request that was refused."""
    headers = {"Accept-Encoding": "identity"}
    with httpx.Client(base_url=url.rstrip("/"), headers=headers, timeout=TIMEOUT_S, transport=transport) as client:
        experiment = _experiment(client, f"cnctwin/{card.kind}/{card.machine}")
        name = f"{card.kind} {card.machine} {card.version}"
        tags = _pairs(_tags(card))
        asked = {"experiment_id": experiment, "run_name": name, "start_time": at_ms, "tags": tags[:BATCH_MAX]}
        info = _post(client, "runs/create", asked)["run"]["info"]
        run = info["run_id"]
        for batch in _batches(_pairs(_parameters(card))):
            _post(client, "runs/log-batch", {"run_id": run, "params": batch})
        metrics = [
            {"key": _key(key), "value": value, "timestamp": at_ms, "step": 0}
            for key, value in sorted(card.held_out.items())
            if math.isfinite(value)
        ]
        if metrics:
            _post(client, "runs/log-batch", {"run_id": run, "metrics": metrics[:METRICS_MAX]})
        uploaded = _artifacts(client, str(info.get("artifact_uri", "")), folder)
        _post(client, "runs/update", {"run_id": run, "status": "FINISHED", "end_time": at_ms})
    return {"experiment_id": experiment, "run_id": run, "artifacts": uploaded}


def _experiment(client: httpx.Client, name: str) -> str:
    """The experiment of a machine's models; made where there is none."""
    found = _sent(client, "GET", f"{API}/experiments/get-by-name", params={"experiment_name": name})
    if found.status_code == 404:
        return str(_post(client, "experiments/create", {"name": name})["experiment_id"])
    return str(_answer(found)["experiment"]["experiment_id"])


def _artifacts(client: httpx.Client, uri: str, folder: Path) -> list[str] | str:
    """Names of what was uploaded; why nothing was."""
    place = urlsplit(uri)
    if place.scheme != "mlflow-artifacts":
        return f"not uploaded: the server keeps artifacts at {place.scheme or 'a folder'}, and takes none over HTTP"
    done = []
    for name in (MANIFEST, CARD):
        path = folder / name
        if path.is_file():
            target = f"{ARTIFACTS}/{quote(place.path.strip('/'))}/{name}"
            _answer(_sent(client, "PUT", target, content=path.read_bytes()))
            done.append(name)
    return done


def _parameters(card: Card) -> dict[str, str]:
    return {
        "features": ", ".join(card.features),
        "seed": "" if card.seed is None else str(card.seed),
        "trained_from": card.from_,
        "trained_to": card.to,
        "code_version": card.code_version,
    }


def _tags(card: Card) -> dict[str, str]:
    told = {"cnctwin.kind": card.kind, "cnctwin.machine": card.machine, "cnctwin.version": card.version}
    told |= {"cnctwin.data_sha256": card.data_sha256, "cnctwin.source": ", ".join(card.source)}
    return told | {f"cnctwin.sha256.{name}": sha256 for name, sha256 in sorted(card.files.items())}


def _pairs(told: dict[str, str]) -> list[dict[str, str]]:
    return [{"key": _key(key), "value": value[:TEXT_MAX]} for key, value in told.items() if value]


def _key(text: str) -> str:
    """MLflow takes letters, digits, and _ - . : / and spaces."""
    return "".join(letter if letter.isalnum() or letter in "_-.:/ " else "_" for letter in text)[:250]


def _batches(pairs: Sequence[dict[str, str]]) -> Iterator[Sequence[dict[str, str]]]:
    for start in range(0, len(pairs), BATCH_MAX):
        yield pairs[start : start + BATCH_MAX]


def _post(client: httpx.Client, what: str, body: dict[str, Any]) -> dict[str, Any]:
    return _answer(_sent(client, "POST", f"{API}/{what}", json=body))


class _Answer(NamedTuple):
    status_code: int
    text: str
    url: httpx.URL


def _sent(client: httpx.Client, method: str, path: str, **given: Any) -> _Answer:
    """Return the answer, which is read within bounds and never decoded."""
    body, until_s = bytearray(), time.monotonic() + TIMEOUT_S
    where = f"MLflow at {shown_address(str(client.base_url))}"
    try:
        with client.stream(method, path, **given) as response:
            if (encoding := response.headers.get("content-encoding", "identity")) != "identity":
                raise UsageError(f"{where} sends Content-Encoding {encoding[:40]!r}, which was not asked for")
            for piece in response.iter_bytes():  # which decodes nothing of this encoding
                body += piece
                if len(body) > ANSWER_BYTES_MAX or time.monotonic() > until_s:
                    raise UsageError(
                        f"MLflow's answer to {path} has more than {ANSWER_BYTES_MAX} bytes or takes longer than {TIMEOUT_S:g} s; "
                        f"is {client.base_url.host} an MLflow server?"
                    )
            return _Answer(response.status_code, body.decode(errors="replace"), response.request.url)
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise UsageError(f"{where}: {error or type(error).__name__}; does it run?") from None


def _answer(response: _Answer) -> dict[str, Any]:
    path = response.url.path
    if response.status_code >= 400:
        text = " ".join(response.text.split())[:300]
        raise UsageError(f"MLflow refused {path}: {response.status_code} {text}")
    try:
        found = json.loads(response.text) if response.text else {}
    except (ValueError, RecursionError):
        raise UsageError(f"MLflow's answer to {path} is no JSON; is {response.url.host} an MLflow server?") from None
    return found if isinstance(found, dict) else {}
