"""Rights and topics as the scripts of deploy/kafka ask Kafka's own programs for them, without a Kafka."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from tests.deploy.plant import DEPLOY

FOLDER = DEPLOY / "kafka"
ADMIN = ("--bootstrap-server", "kafka:9093", "--command-config", "admin.properties")
KINDS = ("--topic", "--group", "--transactional-id")


class Right(NamedTuple):
    """`user` may do `operation` with whatever of this kind begins so."""

    user: str
    operation: str
    kind: str
    prefix: str


def asked_by(script: str, **variables: str) -> list[list[str]]:
    """The calls of Kafka's programs that a script makes; these only note what they were asked for."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("kafka-acls.sh", "kafka-topics.sh"):
            program = Path(folder) / name
            program.write_text(f"#!{sys.executable}\nimport json, sys\nprint(json.dumps(sys.argv[1:]))\n")
            program.chmod(0o755)
        done = subprocess.run(
            ["bash", str(FOLDER / script), *ADMIN],
            env={"PATH": os.environ["PATH"], "KAFKA_BIN": folder, **variables},
            capture_output=True,
            text=True,
            check=True,
        )
    return [json.loads(line) for line in done.stdout.splitlines()]


def rights(**variables: str) -> set[Right]:
    """The rights that deploy/kafka/acls gives."""
    found = set()
    for words in asked_by("acls", **variables):
        assert tuple(words[:4]) == ADMIN
        pairs = [(word, words[index + 1]) for index, word in enumerate(words[:-1]) if word.startswith("--")]
        given = dict(pairs)
        assert given["--resource-pattern-type"] == "prefixed"
        user = given["--allow-principal"].removeprefix("User:")
        found |= {Right(user, given["--operation"], kind, value) for kind, value in pairs if kind in KINDS}
    return found
