"""A bad setting is one line that names the key, the value and what is wrong with it, before anything is connected."""

from pathlib import Path

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.settings import KafkaSettings, settings_of
from cnctwin.kafka.topics import Topics, configuration
from processors.errors import ConfigurationError

BAD = {
    "bootstrap": "",
    "security_protocol": "tls",
    "sasl_mechanism": "GSSAPI",
    "partitions": "0",
    "replication_factor": "many",
    "retention_hours": "-1",
    "create_topics": "perhaps",
    "session_s": "0.5",
    "transaction_s": "1000",
    "snapshot_s": "nan",
    "buffer_mb": "0",
}


@pytest.mark.parametrize("key", BAD)
def test_a_bad_value_is_one_line(key: str) -> None:
    environment = {"CNCTWIN_KAFKA_BOOTSTRAP": "k:9092", f"CNCTWIN_KAFKA_{key.upper()}": BAD[key]}
    with pytest.raises(ConfigurationError) as refused:
        settings_of(None, None, environment)
    said = str(refused.value)
    assert key in said and repr(BAD[key]) in said and "\n" not in said


def test_the_environment_goes_before_the_file_and_the_command_line_before_both(tmp_path: Path) -> None:
    file = tmp_path / "kafka.toml"
    file.write_text('bootstrap = "file:1"\npartitions = 3\nsnapshot_s = 2.0\n')
    settings = settings_of("line:3", file, {"CNCTWIN_KAFKA_BOOTSTRAP": "environment:2", "CNCTWIN_KAFKA_PARTITIONS": "5"})
    assert (settings.bootstrap, settings.partitions, settings.snapshot_s) == ("line:3", 5, 2.0)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("bootstrap = ", "kafka.toml"), ('bootstrap = "k"\npasword_file = "x"', "pasword_file"), ("partitions = 3", "bootstrap")],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, wanted: str) -> None:
    file = tmp_path / "kafka.toml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=wanted):
        settings_of(None, file, {})
    with pytest.raises(ConfigurationError, match="No such file"):
        settings_of(None, tmp_path / "none.toml", {})


def test_a_missing_secret_is_said_with_the_way_out(tmp_path: Path) -> None:
    bare = {"bootstrap": "k:9093", "security_protocol": "sasl_ssl"}
    with pytest.raises(ConfigurationError, match="needs a username"):
        KafkaSettings.model_validate(bare).client({})
    named = KafkaSettings.model_validate(bare | {"username": "anna"})
    with pytest.raises(ConfigurationError, match=r"password of anna is missing; set CNCTWIN_KAFKA_PASSWORD or password_file"):
        named.client({})
    assert named.client({"CNCTWIN_KAFKA_PASSWORD": "secret"})["sasl.password"] == "secret"
    filed = KafkaSettings.model_validate(bare | {"username": "anna", "password_file": str(tmp_path / "password")})
    with pytest.raises(ConfigurationError, match="No such file"):
        filed.client({})
    (tmp_path / "password").write_text("of the file\n")
    assert filed.client({})["sasl.password"] == "of the file"


def test_names_of_topics_and_groups() -> None:
    topics = Topics("mills")
    assert topics.cells("alerts") == "cnctwin.mills.cells.alerts"
    assert topics.runners(["thermal", "mirror"]) == "cnctwin.mills.mirror+thermal"
    assert topics.bridge("b0") == "cnctwin.mills.bridge.b0"
    compacted = {name for name, of in topics.all(["alerts"]).items() if of["cleanup.policy"] == "compact"}
    assert compacted == {f"cnctwin.mills.{name}" for name in ("snapshots", "births", "health")}


def test_what_was_acknowledged_outlives_a_broker_where_there_are_three() -> None:
    for replicas, wanted in ((1, None), (2, None), (3, "2"), (5, "2")):
        settings = KafkaSettings(bootstrap="k:1", replication_factor=replicas)
        for kept in Topics("cnc").all(["alerts"]).values():
            made = configuration(settings, kept)
            assert made.get("min.insync.replicas") == wanted
            assert ("retention.ms" in made) == (made["cleanup.policy"] == "delete")
