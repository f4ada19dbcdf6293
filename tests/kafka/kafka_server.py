"""Apache Kafka, broker and controller in one Java process that ends with the tests. Fetched once by Maven."""

from __future__ import annotations

import resource
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal

from tests.deploy.plant import certificates, password_of
from tests.wire import maven
from tests.wire.mosquitto import free_port

if TYPE_CHECKING:
    from confluent_kafka.admin import AdminClient

HERE = Path(__file__).parent
START_S_MAX = 120.0
STOP_S_MAX = 30.0
ANSWER_S_MAX = 10.0
CLUSTER = "Y25jdHdpbi11bmRlci10ZQ"
ADMIN = "admin"
MECHANISM = "SCRAM-SHA-512"
JAVA_OPTIONS = ("-Xmx512m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-Djava.awt.headless=true")
# One broker cannot have more than one replica, and what is there for thousands of partitions takes time and memory.
ALONE = {
    "offsets.topic.replication.factor": "1",
    "offsets.topic.num.partitions": "4",
    "transaction.state.log.replication.factor": "1",
    "transaction.state.log.min.isr": "1",
    "transaction.state.log.num.partitions": "4",
    "share.coordinator.state.topic.replication.factor": "1",
    "share.coordinator.state.topic.min.isr": "1",
    "log.cleaner.backoff.ms": "200",
    "log.cleaner.dedupe.buffer.size": "4194304",
    "num.network.threads": "2",
    "num.io.threads": "4",
    "group.initial.rebalance.delay.ms": "0",
    "group.min.session.timeout.ms": "1000",
    "auto.create.topics.enable": "false",
    # After a kill -9 the controller waits for so long before it takes the new process for the same broker; by default 9 s.
    "broker.session.timeout.ms": "3000",
    "broker.heartbeat.interval.ms": "300",
}


def built() -> Path:
    """The folder with our class and Kafka's; skips the test where it cannot be made."""
    return maven.built(HERE, "Kafka")


class KafkaServer:
    """One Kafka on 127.0.0.1 that keeps its ports and data over `kill` and `restart`.

    With `security="sasl_ssl"` clients come with TLS and a user of `users`, or "admin", who may do all; the others may do what
    `allow` gives them. `settings` are those of server.properties and go before ours.

    `file_bytes_max` stands in for a full disk: no file of the process may grow beyond it (RLIMIT_FSIZE, the soft limit, which
    `limit_files` sets and lifts while Kafka runs). A write past it fails with EFBIG where a full disk fails with ENOSPC; Java
    makes an IOException of both, and Kafka, whose only log directory has failed, ends. Unlike a full disk it meets single files:
    a segment that reaches the limit, not one that is small. Take more than 10,485,760, which Kafka reserves for each index: with
    less it does not start, and while it runs it names a new topic and cannot write it.
    """

    def __init__(
        self,
        home: Path,
        *,
        port: int | None = None,
        security: Literal["plaintext", "sasl_ssl"] = "plaintext",
        users: Sequence[str] = ("cnctwin", "other"),
        file_bytes_max: int | None = None,
        settings: Mapping[str, str] = {},
    ) -> None:
        self.home, self.security, self.users = home, security, (ADMIN, *users)
        self.port, self._controller_port = free_port() if port is None else port, free_port()
        self.authority, self.log = home / "authority", home / "log"
        self._file_bytes_max, self._settings = file_bytes_max, settings
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def bootstrap(self) -> str:
        """The address that a client begins with."""
        return f"127.0.0.1:{self.port}"

    @property
    def pid(self) -> int:
        """The process id."""
        assert self._process is not None, "Kafka was not started"
        return self._process.pid

    @property
    def ca_file(self) -> Path:
        """The authority that signed the certificate of the listener."""
        return self.authority / "ca.pem"

    @property
    def running(self) -> bool:
        """True if the process lives."""
        return self._process is not None and self._process.poll() is None

    def client(self, user: str = ADMIN, password: str | None = None) -> dict[str, str | int | float | bool]:
        """The settings of confluent-kafka with which `user` comes in."""
        settings: dict[str, str | int | float | bool] = {"bootstrap.servers": self.bootstrap, "log_level": 0}
        if self.security == "sasl_ssl":
            settings |= {
                "security.protocol": "sasl_ssl",
                "sasl.mechanism": MECHANISM,
                "sasl.username": user,
                "sasl.password": password_of(user) if password is None else password,
                "ssl.ca.location": str(self.ca_file),
            }
        return settings

    def admin(self) -> AdminClient:
        """A client that may do all. Keep it until its futures are done: collected before, it cancels them."""
        from confluent_kafka.admin import AdminClient

        return AdminClient(self.client())

    def create_topics(self, *names: str, partitions: int = 1, config: Mapping[str, str] = {}) -> None:
        """Create topics, and return once the broker leads all their partitions."""
        from confluent_kafka.admin import NewTopic

        admin = self.admin()
        made = admin.create_topics([NewTopic(name, partitions, 1, config=dict(config)) for name in names])
        for future in made.values():
            future.result(ANSWER_S_MAX)
        until = time.monotonic() + ANSWER_S_MAX
        for name in names:
            while True:
                found = admin.list_topics(name, timeout=ANSWER_S_MAX).topics[name].partitions
                if len(found) == partitions and all(one.leader >= 0 for one in found.values()):
                    break
                assert time.monotonic() < until, f"topic {name} has no leader after {ANSWER_S_MAX:g} s"
                time.sleep(0.02)

    def allow(
        self,
        user: str,
        kind: Literal["topic", "group", "transactional_id", "cluster"],
        name: str,
        *operations: str,
        prefixed: bool = False,
    ) -> None:
        """Let `user` do `operations` (read, write, describe, create, all …) on a resource, or on all that begin with `name`."""
        from confluent_kafka.admin import (
            AclBinding,
            AclBindingFilter,
            AclOperation,
            AclPermissionType,
            ResourcePatternType,
            ResourceType,
        )

        pattern = ResourcePatternType.PREFIXED if prefixed else ResourcePatternType.LITERAL
        admin = self.admin()
        for operation in operations:
            rule = (
                ResourceType["BROKER" if kind == "cluster" else kind.upper()],
                "kafka-cluster" if kind == "cluster" else name,
                pattern,
                f"User:{user}",
                "*",
                AclOperation[operation.upper()],
                AclPermissionType.ALLOW,
            )
            for future in admin.create_acls([AclBinding(*rule)]).values():
                future.result(ANSWER_S_MAX)
            # The controller has it; the broker may be a moment behind.
            until = time.monotonic() + ANSWER_S_MAX
            while not admin.describe_acls(AclBindingFilter(*rule)).result(ANSWER_S_MAX):
                assert time.monotonic() < until, f"the broker does not know the rule {rule}"
                time.sleep(0.02)

    def limit_files(self, file_bytes_max: int | None) -> None:
        """Let no file of Kafka's grow beyond this, from now on and after a restart; None lifts the limit."""
        self._file_bytes_max = file_bytes_max
        if self.running:
            soft = resource.RLIM_INFINITY if file_bytes_max is None else file_bytes_max
            resource.prlimit(self.pid, resource.RLIMIT_FSIZE, (soft, resource.RLIM_INFINITY))

    def start(self) -> None:
        """Start it, with the data that it has, and return once it answers."""
        assert not self.running, "Kafka runs already"
        classes, properties = built(), self.home / "server.properties"
        if not properties.exists():
            if self.security == "sasl_ssl":
                self._papers()
            properties.write_text("".join(f"{name}={value}\n" for name, value in self._properties().items()))
        format_options = ["--config", str(properties), "--cluster-id", CLUSTER, "--ignore-formatted"]
        if self.security == "sasl_ssl":
            for user in self.users:
                format_options += ["--add-scram", f'{MECHANISM}=[name="{user}",password="{password_of(user)}"]']
        command = ["java", *JAVA_OPTIONS, "-cp", f"{classes}/classes:{classes}/lib/*", "cnctwin.Server", str(properties)]
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [*command, *format_options], cwd=self.home, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT
            )
        self.limit_files(self._file_bytes_max)
        try:
            self._wait_until_it_answers()
        except BaseException:
            self.kill()
            raise

    def _wait_until_it_answers(self) -> None:
        from confluent_kafka import KafkaException

        until = time.monotonic() + START_S_MAX
        admin = self.admin()
        while True:
            assert self.running, f"Kafka ended: {self.last_words()}"
            assert time.monotonic() < until, f"Kafka does not answer after {START_S_MAX:g} s: {self.last_words()}"
            try:
                if admin.list_topics(timeout=0.5).brokers:
                    return
            except KafkaException:
                time.sleep(0.05)

    def last_words(self) -> str:
        """Return the end of its log."""
        return self.log.read_text(errors="replace")[-2000:]

    def kill(self) -> None:
        """End it as a power cut of the machine's process does (-9)."""
        assert self._process is not None, "Kafka was not started"
        self._process.kill()
        self._gone()

    def stop(self) -> None:
        """Let it hand on and close what it has (SIGTERM)."""
        assert self._process is not None, "Kafka was not started"
        self._process.terminate()
        try:
            self._process.wait(STOP_S_MAX)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._gone()

    def wait(self, timeout_s: float) -> int:
        """Wait until it has ended by itself; its exit status. Raises TimeoutExpired where it goes on."""
        assert self._process is not None, "Kafka was not started"
        status = self._process.wait(timeout_s)
        self._gone()
        return status

    def _gone(self) -> None:
        assert self._process is not None and self._process.stdin is not None
        self._process.wait()
        self._process.stdin.close()

    def restart(self) -> None:
        """End it by -9 and start it again on the same ports and data."""
        self.kill()
        self.start()

    def __enter__(self) -> KafkaServer:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._process is not None:
            self.kill()  # what it holds goes with the folder

    def _papers(self) -> None:
        certificates("init", self.authority)
        certificates("server", self.authority, "broker", "--host", "127.0.0.1")
        # Kafka wants the key and its certificate in one file.
        keystore = self.authority / "keystore.pem"
        keystore.touch(0o600)
        keystore.write_text("".join((self.authority / part).read_text() for part in ("broker.key", "broker.pem")))

    def _properties(self) -> dict[str, str]:
        secured = self.security == "sasl_ssl"
        properties = {
            "process.roles": "broker,controller",
            "node.id": "1",
            "controller.quorum.voters": f"1@127.0.0.1:{self._controller_port}",
            "listeners": f"CLIENTS://{self.bootstrap},CONTROLLER://127.0.0.1:{self._controller_port}",
            "advertised.listeners": f"CLIENTS://{self.bootstrap}",
            "listener.security.protocol.map": f"CLIENTS:{self.security.upper()},CONTROLLER:PLAINTEXT",
            "controller.listener.names": "CONTROLLER",
            "inter.broker.listener.name": "CLIENTS",
            "log.dirs": str(self.home / "data"),
            **ALONE,
        }
        if secured:
            login = f'username="{ADMIN}" password="{password_of(ADMIN)}"'
            module = f"org.apache.kafka.common.security.scram.ScramLoginModule required {login};"
            properties |= {
                "sasl.enabled.mechanisms": MECHANISM,
                "sasl.mechanism.inter.broker.protocol": MECHANISM,  # the broker writes the ends of transactions to itself
                f"listener.name.clients.{MECHANISM.lower()}.sasl.jaas.config": module,
                "ssl.keystore.type": "PEM",
                "ssl.keystore.location": str(self.authority / "keystore.pem"),
                "ssl.truststore.type": "PEM",
                "ssl.truststore.location": str(self.ca_file),
                "authorizer.class.name": "org.apache.kafka.metadata.authorizer.StandardAuthorizer",
                # On the controller's listener, on loopback and without users, everybody is ANONYMOUS; nobody is on the other one.
                "super.users": f"User:{ADMIN};User:ANONYMOUS",
            }
        return properties | dict(self._settings)
