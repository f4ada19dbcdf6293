"""Kafka, started once for all tests of this folder: they run on one worker (`TOGETHER` in tests/conftest.py)."""

import shutil
from collections.abc import Iterator

import pytest

from tests.kafka.kafka_server import KafkaServer, built

NEEDED = "no confluent-kafka in this Python; install the extra kafka"


@pytest.fixture(scope="session")
def kafka(tmp_path_factory: pytest.TempPathFactory) -> Iterator[KafkaServer]:
    """Kafka without users and rules. Take topics of your own; a test may kill it, and fill its disk."""
    pytest.importorskip("confluent_kafka", reason=NEEDED)
    built()
    with KafkaServer(tmp_path_factory.mktemp("kafka")) as server:
        yield server


@pytest.fixture(scope="session")
def secured_kafka(tmp_path_factory: pytest.TempPathFactory) -> Iterator[KafkaServer]:
    """Kafka with TLS, and with users who may do nothing until `allow` gives it to them."""
    pytest.importorskip("confluent_kafka", reason=NEEDED)
    built()
    if shutil.which("openssl") is None:
        pytest.skip("no openssl on this machine; install the package openssl")
    with KafkaServer(tmp_path_factory.mktemp("secured-kafka"), security="sasl_ssl") as server:
        yield server


@pytest.fixture(autouse=True)
def _kafka_runs_again(request: pytest.FixtureRequest) -> Iterator[None]:
    """The next test finds it alive and with room on its disk, whatever became of this one."""
    server = request.getfixturevalue("kafka") if "kafka" in request.fixturenames else None
    yield
    if server is not None:
        server.limit_files(None)
        if not server.running:
            server.start()
