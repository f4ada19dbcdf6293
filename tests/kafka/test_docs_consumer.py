"""The consumer that docs/how-to/kafka.md prints runs as it stands."""

import re
import subprocess
import sys
from pathlib import Path

from tests.kafka.kafka_server import KafkaServer
from tests.kafka.plant_on_kafka import Plant, processors
from tests.processors.streams import birth, data
from tests.recordings import PROJECT

FOUND = re.compile(r"<!-- kafka consumer -->\n```python\n(.*?)```", re.DOTALL)


def test_the_consumer_of_the_page_prints_what_a_machine_says(kafka: KafkaServer, tmp_path: Path) -> None:
    found = FOUND.search((PROJECT / "docs" / "how-to" / "kafka.md").read_text(encoding="utf-8"))
    assert found is not None
    program = tmp_path / "consumer.py"
    program.write_text(found[1].replace("kafka:9092", kafka.bootstrap).replace("cnctwin.cnc.", "cnctwin.docs."))
    with Plant(kafka, "docs", processors("thermal")) as plant:
        plant.say(birth(0.0, device="m-0", spindle_rpm=0.0), 0.0)
        plant.say(data(1.0, device="m-0", spindle_rpm=4000.0), 1.0)
        plant.delivered()
        with subprocess.Popen([sys.executable, "-u", program], cwd=PROJECT, stdout=subprocess.PIPE, text=True) as consumer:
            assert consumer.stdout is not None
            said = [consumer.stdout.readline().split() for _ in range(2)]
            consumer.kill()
    assert [line[:3] for line in said] == [["m-0", "spindle_rpm", "0.0"], ["m-0", "spindle_rpm", "4000.0"]]
    assert said[1][3:5] == ["rev/min", "GOOD"]
