"""The cluster and its topics, as `kafka.toml` and the environment say: a typed model, checked before any I/O.

Each key may also be given as `CNCTWIN_KAFKA_<KEY>`, which goes before the file. A password stands in neither a file of
configuration nor a command line: it comes from `CNCTWIN_KAFKA_PASSWORD`, or from the file that `password_file` names.
"""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cnctwin.kafka.client_log import LOG, REACH
from processors.errors import ConfigurationError

PREFIX = "CNCTWIN_KAFKA_"
PASSWORD = f"{PREFIX}PASSWORD"
MESSAGE_BYTES_MAX = 64 * 1024 * 1024
BUFFER_SHARE = 2  # of the buffer is what one message may fill
Conf = dict[str, Any]


class KafkaSettings(BaseModel):
    """See the module and docs/how-to/kafka.md.

    partitions: of each topic; machines stay where they are only while it does not change
    retention_hours: of readings, cells and results
    session_s: after which a runner that says nothing is taken for dead, and its partitions go to others
    buffer_mb: memory for the records that a bridge keeps while the cluster is away; a third more at most
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    bootstrap: str = Field(min_length=1)
    security_protocol: Literal["plaintext", "ssl", "sasl_plaintext", "sasl_ssl"] = "plaintext"
    sasl_mechanism: Literal["PLAIN", "SCRAM-SHA-256", "SCRAM-SHA-512"] = "SCRAM-SHA-512"
    username: str = ""
    password_file: str = ""
    ca_file: str = ""
    certificate_file: str = ""
    key_file: str = ""
    partitions: int = Field(default=12, ge=1, le=1000)
    replication_factor: int = Field(default=3, ge=1, le=10)
    retention_hours: float = Field(default=48.0, gt=0.0, le=100_000.0)
    create_topics: bool = True
    session_s: float = Field(default=6.0, ge=1.0, le=300.0)
    transaction_s: float = Field(default=30.0, ge=1.0, le=900.0)
    snapshot_s: float = Field(default=5.0, ge=0.1, le=600.0)
    buffer_mb: float = Field(default=256.0, ge=1.0, le=65_536.0)

    def client(self, environment: Mapping[str, str] = os.environ) -> Conf:
        """Return what a client of confluent_kafka wants to know to connect, and where it tells of its troubles when it is polled.
        Raises ConfigurationError where a secret is missing."""
        conf: Conf = {"bootstrap.servers": self.bootstrap, "security.protocol": self.security_protocol}
        conf |= {"logger": LOG, "error_cb": REACH.failed}
        if self.security_protocol.startswith("sasl"):
            conf |= {
                "sasl.mechanism": self.sasl_mechanism,
                "sasl.username": self.username,
                "sasl.password": self._password(environment),
            }
        files = {
            "ssl.ca.location": self.ca_file,
            "ssl.certificate.location": self.certificate_file,
            "ssl.key.location": self.key_file,
        }
        return conf | {name: path for name, path in files.items() if path}

    @property
    def message_bytes_max(self) -> int:
        """The size, in bytes, of the largest message that a client of ours sends; a topic may accept less."""
        return min(round(self.buffer_mb * 1024 * 1024) // BUFFER_SHARE, MESSAGE_BYTES_MAX)

    def _password(self, environment: Mapping[str, str]) -> str:
        if not self.username:
            raise ConfigurationError(f"kafka: {self.security_protocol} needs a username; give username or {PREFIX}USERNAME")
        if given := environment.get(PASSWORD):
            return given
        if not self.password_file:
            raise ConfigurationError(f"kafka: the password of {self.username} is missing; set {PASSWORD} or password_file")
        try:
            return Path(self.password_file).read_text(encoding="utf-8").strip()
        except OSError as error:
            raise ConfigurationError(f"kafka: password_file {self.password_file}: {error.strerror}") from error


def settings_of(bootstrap: str | None, path: Path | None, environment: Mapping[str, str] = os.environ) -> KafkaSettings:
    """Return the settings: the file's, over them those of the environment, over them the command line's bootstrap servers.

    Raises ConfigurationError, naming the key.
    """
    table: dict[str, Any] = {}
    if path is not None:
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigurationError(f"{path}: {error.strerror}") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"{path}: {error}") from error
    for key in KafkaSettings.model_fields:
        if (given := environment.get(f"{PREFIX}{key.upper()}")) is not None:
            table[key] = given
    if bootstrap:
        table["bootstrap"] = bootstrap
    try:
        return KafkaSettings.model_validate(table)
    except ValidationError as error:
        from twin.vocabulary.faults import faults_of, report  # noqa: PLC0415  only where something is wrong

        faults = faults_of([dict(fault) for fault in error.errors(include_url=False)], KafkaSettings)
        raise ConfigurationError(report(path or "kafka", faults, "docs/how-to/kafka.md")) from None
