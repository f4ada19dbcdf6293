"""Rights and topics on Kafka: what the scripts of deploy/kafka ask of Kafka's own programs, on every topic there is."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.deploy.kafka_names import (
    BRIDGE,
    GROUPS,
    KEPT_FOR_A_WHILE,
    MAY_READ,
    MAY_WRITE,
    PREFIX,
    RUNNER,
    TOPICS,
    TRANSACTION,
)
from tests.deploy.plant import DEPLOY

FOLDER = DEPLOY / "kafka"
ADMIN = ("--bootstrap-server", "kafka:9093", "--command-config", "admin.properties")
KINDS = ("--topic", "--group", "--transactional-id")
HOUR_MS = 3_600_000


class Right(NamedTuple):
    """`user` may do `operation` with whatever of this kind begins so."""

    user: str
    operation: str
    kind: str
    prefix: str


Run = Callable[..., list[list[str]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Runs a script with programs of Kafka that only note what they were asked for."""
    for name in ("kafka-acls.sh", "kafka-topics.sh"):
        program = tmp_path / name
        program.write_text(f"#!{sys.executable}\nimport json, sys\nprint(json.dumps(sys.argv[1:]))\n")
        program.chmod(0o755)

    def asked(script: str, **variables: str) -> list[list[str]]:
        done = subprocess.run(
            ["bash", str(FOLDER / script), *ADMIN],
            env={"PATH": os.environ["PATH"], "KAFKA_BIN": str(tmp_path), **variables},
            capture_output=True,
            text=True,
            check=True,
        )
        return [json.loads(line) for line in done.stdout.splitlines()]

    return asked


def rights(asked: list[list[str]]) -> set[Right]:
    """The rights that calls of kafka-acls.sh give."""
    found = set()
    for words in asked:
        assert tuple(words[:4]) == ADMIN
        pairs = [(word, words[index + 1]) for index, word in enumerate(words[:-1]) if word.startswith("--")]
        given = dict(pairs)
        assert given["--resource-pattern-type"] == "prefixed"
        user = given["--allow-principal"].removeprefix("User:")
        found |= {Right(user, given["--operation"], kind, value) for kind, value in pairs if kind in KINDS}
    return found


def may(given: set[Right], user: str, operation: str, kind: str, name: str) -> bool:
    return any(one[:3] == (user, operation, kind) and name.startswith(one.prefix) for one in given)


def test_each_may_read_and_write_the_topics_that_it_has_to_and_no_other(run: Run) -> None:
    given = rights(run("acls"))
    for user, topic in product((BRIDGE, RUNNER), TOPICS):
        assert may(given, user, "Write", "--topic", PREFIX + topic) == (topic in MAY_WRITE[user]), (user, topic)
        assert may(given, user, "Read", "--topic", PREFIX + topic) == (topic in MAY_READ[user]), (user, topic)
    assert not any(may(given, user, verb, "--topic", "other") for user, verb in product((BRIDGE, RUNNER), ("Read", "Write")))


def test_each_has_its_consumer_group_and_only_runners_have_transactions(run: Run) -> None:
    given = rights(run("acls"))
    for user, group in GROUPS.items():
        assert may(given, user, "Read", "--group", group)
        assert not may(given, user, "Read", "--group", "elsewhere")
    assert not may(given, BRIDGE, "Read", "--group", GROUPS[RUNNER])
    assert may(given, RUNNER, "Write", "--transactional-id", TRANSACTION)
    assert not any(right.kind == "--transactional-id" for right in given if right.user == BRIDGE)


def test_nobody_may_make_topics_unless_the_site_says_so(run: Run) -> None:
    plain, more = rights(run("acls")), rights(run("acls", CREATE="yes"))
    assert {right.operation for right in plain} == {"Read", "Write"}
    assert more - plain == {Right(user, "Create", "--topic", PREFIX) for user in (BRIDGE, RUNNER)}


def test_what_is_given_can_be_taken_away(run: Run) -> None:
    given, taken = run("acls", CREATE="yes"), run("acls", REMOVE="yes")
    assert [["--add" if word == "--remove" else word for word in words] for words in taken] == given
    assert all("--force" in words for words in taken), "it would ask, and wait"


def test_another_group_has_names_of_its_own(run: Run) -> None:
    assert all(right.prefix.startswith("cnctwin.mills.") for right in rights(run("acls", GROUP="mills")))
    assert all("cnctwin.mills." in " ".join(words) for words in run("topics", GROUP="mills"))


def test_all_topics_are_made_with_one_number_of_partitions(run: Run) -> None:
    asked = run("topics", PARTITIONS="7", RETENTION_HOURS="5")
    made = {words[words.index("--topic") + 1].removeprefix(PREFIX): words for words in asked}
    assert set(made) == set(TOPICS) and len(asked) == len(TOPICS)
    assert {words[words.index("--partitions") + 1] for words in asked} == {"7"}
    for topic, words in made.items():
        configs = {words[index + 1] for index, word in enumerate(words) if word == "--config"}
        kept = (
            {"cleanup.policy=delete", f"retention.ms={5 * HOUR_MS}"} if topic in KEPT_FOR_A_WHILE else {"cleanup.policy=compact"}
        )
        assert configs == kept | {"min.insync.replicas=2"}, topic
        assert "--if-not-exists" in words
    alone = run("topics", REPLICATION="1")
    assert not any("min.insync.replicas=2" in words for words in alone), "one broker could never acknowledge"


def test_the_defaults_of_the_topics_are_those_that_the_programs_are_configured_with(run: Run) -> None:
    text = (FOLDER / "kafka.toml").read_text()
    words = run("topics")[0]
    for key, name in (("partitions", "--partitions"), ("replication_factor", "--replication-factor")):
        assert re.search(rf"^{key} = {words[words.index(name) + 1]}$", text, re.M)
    (hours,) = re.findall(r"^retention_hours = ([\d.]+)$", text, re.M)
    assert f"retention.ms={float(hours) * HOUR_MS:.0f}" in words


@pytest.mark.parametrize("script", ["acls", "topics"])
def test_without_an_address_a_script_says_how_it_is_used(script: str) -> None:
    done = subprocess.run(["bash", str(FOLDER / script)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"deploy/kafka/{script} --bootstrap-server" in done.stderr
