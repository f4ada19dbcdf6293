"""A Kafka of one node on loopback, from jars of Maven Central, for as long as a benchmark runs."""

import socket
import subprocess
import time
import uuid
from base64 import urlsafe_b64encode
from pathlib import Path

START_S_MAX, STOP_S_MAX = 60.0, 20.0
JAVA = ["java", "-Xmx512m", "-XX:+UseSerialGC", "-cp"]
PROPERTIES = """\
process.roles=broker,controller
node.id=1
controller.quorum.voters=1@127.0.0.1:{controller}
listeners=PLAINTEXT://127.0.0.1:{broker},CONTROLLER://127.0.0.1:{controller}
advertised.listeners=PLAINTEXT://127.0.0.1:{broker}
controller.listener.names=CONTROLLER
log.dirs={folder}/logs
offsets.topic.replication.factor=1
offsets.topic.num.partitions=4
transaction.state.log.replication.factor=1
transaction.state.log.min.isr=1
transaction.state.log.num.partitions=4
share.coordinator.state.topic.replication.factor=1
share.coordinator.state.topic.min.isr=1
group.initial.rebalance.delay.ms=0
auto.create.topics.enable=false
"""
LOGGING = """<Configuration><Appenders><Console name="out"><PatternLayout pattern="%d %p %m (%c)%n"/></Console></Appenders>
<Loggers><Root level="warn"><AppenderRef ref="out"/></Root></Loggers></Configuration>
"""


def free_ports(count: int) -> list[int]:
    """Return ports of loopback that were free a moment ago, all different."""
    probes = [socket.socket() for _ in range(count)]
    try:
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
    finally:
        for probe in probes:
            probe.close()


class KafkaBroker:
    """Broker and controller in one process, on free ports; a context manager that ends it."""

    def __init__(self, jars: Path, folder: Path) -> None:
        self.folder, self._classes = folder.absolute(), f"{jars.absolute()}/*"
        self._port, self._controller = free_ports(2)
        self.address, self.log = f"127.0.0.1:{self._port}", self.folder / "kafka.log"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "KafkaBroker":
        """Format the storage, start, and wait until the port answers."""
        self.folder.mkdir(parents=True, exist_ok=True)
        properties, logging = self.folder / "server.properties", self.folder / "log4j2.xml"
        properties.write_text(PROPERTIES.format(broker=self._port, controller=self._controller, folder=self.folder))
        logging.write_text(LOGGING)
        java = [*JAVA, self._classes, f"-Dlog4j2.configurationFile={logging}"]
        name = urlsafe_b64encode(uuid.uuid4().bytes).rstrip(b"=").decode()
        with self.log.open("wb") as log:
            formatting = [*java, "kafka.tools.StorageTool", "format", f"--cluster-id={name}", "-c", str(properties)]
            subprocess.run(formatting, stdout=log, stderr=log, check=True)
            serving = [*java, "kafka.Kafka", str(properties)]
            self._process = subprocess.Popen(serving, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        until = time.monotonic() + START_S_MAX
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > until:
                self.__exit__()
                raise RuntimeError(f"Kafka does not listen on {self.address}: see {self.log}")
            time.sleep(0.2)
        return self

    def _answers(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self._port)) == 0

    def __exit__(self, *_: object) -> None:
        """End it."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(STOP_S_MAX)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
