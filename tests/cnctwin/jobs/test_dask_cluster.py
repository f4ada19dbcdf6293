"""Pieces on a real Dask cluster: killed workers cost time and no answer, and nothing is waited for without end."""

import json
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import spread as spreading
from cnctwin.errors import SpreadError, UsageError
from cnctwin.jobs.dask_cluster import DaskCluster
from cnctwin.jobs.spread import spread_over
from tests.cnctwin.jobs import pieces
from tests.cnctwin.jobs.dask_processes import DaskProcesses, dask_processes
from twin.errors import TwinError
from twin.optimisation.optimise import NO_HOOKS, Hooks, search

TESTS = ("tests",)
PLAIN = "tcp://dask.plant.example"


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[DaskProcesses]:
    with dask_processes(tmp_path) as processes:
        yield processes


def test_an_optimisation_on_two_workers_one_of_which_is_killed_gives_the_same_answer(dask: DaskProcesses) -> None:
    asked = spreading.question(levels=1, islands=4, evolutions=10, population=16)
    here = search(asked, NO_HOOKS, None)
    cluster = DaskCluster.from_text(dask.start_scheduler())
    victim, _ = (dask.start_worker(cluster.address) for _ in range(2))
    with spread_over(dask=cluster) as spread:
        spreading.wait_for_workers(dask, 2)
        watched = spreading.Watched(spread, victim.kill, epoch=1)
        there = search(asked, Hooks(spread=watched), None)
    assert (victim.poll(), watched.pieces) == (-signal.SIGKILL, 4)
    assert there.genes.tobytes() == here.genes.tobytes()
    assert (there.history, there.evaluations) == (here.history, here.evaluations)


def test_without_a_worker_or_a_scheduler_nobody_waits_for_ever(dask: DaskProcesses, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    texts = [json.dumps([number, str(marks), 0.1]) for number in range(10)]
    cluster = replace(DaskCluster.from_text(dask.start_scheduler()), patience_s=1.5)
    worker = dask.start_worker(cluster.address)
    spreading.wait_for_workers(dask, 1)
    with spread_over(dask=cluster, packages=TESTS) as spread:
        with pytest.raises(TwinError, match="line 7: G2: a bow without I and J"):
            list(spread(pieces.refused, ['"I and J"', '"K"']))
        worker.kill()
        with pytest.raises(SpreadError, match=r"piece 1 of 10 is lost: tcp://127.* has had no worker .* for 2 s"):
            list(spread(pieces.squared, texts))
        assert dask.scheduler is not None
        dask.scheduler.kill()
        with pytest.raises(SpreadError, match=r"lost: (the scheduler tcp://127.* has ended|tcp://127.* has not answered)"):
            list(spread(pieces.squared, texts))
    nobody = f"no Dask scheduler answers at {cluster.address}: .*; start one with `dask scheduler`"
    with pytest.raises(SpreadError, match=nobody), spread_over(dask=cluster):
        pass


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl on this machine")
def test_with_certificates_and_not_without(tmp_path: Path) -> None:
    def openssl(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=tmp_path, capture_output=True, check=True)

    for name in ("ours", "theirs"):
        kind = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc", "-days", "2")
        openssl("req", "-x509", *kind, "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem")
    ours, key, theirs = (str(tmp_path / name) for name in ("ours.pem", "ours.key", "theirs.pem"))
    with dask_processes(tmp_path, ("--tls-ca-file", ours, "--tls-cert", ours, "--tls-key", key)) as dask:
        address = dask.start_scheduler()
        dask.start_worker(address)
        cluster = DaskCluster.from_text(f"{address}?ca_file={ours}&certificate_file={ours}&key_file={key}")
        with spread_over(dask=cluster, packages=TESTS) as spread:
            assert [json.loads(one)["square"] for one in spread(pieces.squared, ["[3]", "[4]"])] == [9, 16]
        wrong = replace(cluster, certificate_file=Path(theirs), key_file=tmp_path / "theirs.key", patience_s=2)
        for stranger in (wrong, DaskCluster("127.0.0.1", cluster.port, patience_s=2)):
            with pytest.raises(SpreadError, match="no Dask scheduler answers at"), spread_over(dask=stranger):
                pass


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PLAIN, "tcp://dask.plant.example:8786 is neither encrypted nor this machine"),
        (f"{PLAIN}?insecure=no", "insecure is not of"),
        (f"{PLAIN}?ca=1", "ca is not of ca_file, certificate_file, key_file, insecure=yes"),
        (f"{PLAIN}?ca_file=a", "is not encrypted, so certificates do nothing"),
        ("tls://dask.plant.example", "needs ca_file, certificate_file, key_file"),
        ("tls://dask?ca_file=/no&certificate_file=/no&key_file=/no", "there is no file /no"),
        ("mqtt://127.0.0.1", "is not tcp://host:8786 or tls://host:8786"),
        ("tcp://127.0.0.1:x", "host, port or options cannot be read"),
    ],
)
def test_an_address_that_is_not_to_be_used(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        DaskCluster.from_text(text)


def test_a_plain_address_of_another_machine_has_to_be_asked_for() -> None:
    assert DaskCluster.from_text(f"{PLAIN}:1?insecure=yes").address == f"{PLAIN}:1"
    assert DaskCluster.from_text("tcp://[::1]").address == "tcp://[::1]:8786"
