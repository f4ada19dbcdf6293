"""Rights and topics on Kafka: what the scripts of deploy/kafka ask of Kafka's own programs, on every topic there is."""

import re
import subprocess
from itertools import product

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import topics as module
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
from tests.deploy.kafka_rights import FOLDER, Right, asked_by, rights

HOUR_MS = 3_600_000
COMPACTED = {f"{key}={value}" for key, value in module.COMPACTED.items()}
"""The configuration with which the programs create compacted topics."""


def may(given: set[Right], user: str, operation: str, kind: str, name: str) -> bool:
    return any(one[:3] == (user, operation, kind) and name.startswith(one.prefix) for one in given)


def test_each_may_read_and_write_the_topics_that_it_has_to_and_no_other() -> None:
    given = rights()
    for user, topic in product((BRIDGE, RUNNER), TOPICS):
        assert may(given, user, "Write", "--topic", PREFIX + topic) == (topic in MAY_WRITE[user]), (user, topic)
        assert may(given, user, "Read", "--topic", PREFIX + topic) == (topic in MAY_READ[user]), (user, topic)
    assert not any(may(given, user, verb, "--topic", "other") for user, verb in product((BRIDGE, RUNNER), ("Read", "Write")))


def test_each_has_its_consumer_group_and_only_runners_have_transactions() -> None:
    given = rights()
    for user, group in GROUPS.items():
        assert may(given, user, "Read", "--group", group)
        assert not may(given, user, "Read", "--group", "elsewhere")
    assert not may(given, BRIDGE, "Read", "--group", GROUPS[RUNNER])
    assert may(given, RUNNER, "Write", "--transactional-id", TRANSACTION)
    assert not any(right.kind == "--transactional-id" for right in given if right.user == BRIDGE)


def test_nobody_may_make_topics_unless_the_site_says_so() -> None:
    plain, more = rights(), rights(CREATE="yes")
    assert {right.operation for right in plain} == {"Read", "Write"}
    assert more - plain == {Right(user, "Create", "--topic", PREFIX) for user in (BRIDGE, RUNNER)}


def test_what_is_given_can_be_taken_away() -> None:
    given, taken = asked_by("acls", CREATE="yes"), asked_by("acls", REMOVE="yes")
    assert [["--add" if word == "--remove" else word for word in words] for words in taken] == given
    assert all("--force" in words for words in taken), "it would ask, and wait"


def test_another_group_has_names_of_its_own() -> None:
    assert all(right.prefix.startswith("cnctwin.mills.") for right in rights(GROUP="mills"))
    assert all("cnctwin.mills." in " ".join(words) for words in asked_by("topics", GROUP="mills"))


def test_all_topics_are_made_with_one_number_of_partitions() -> None:
    asked = asked_by("topics", PARTITIONS="7", RETENTION_HOURS="5")
    made = {words[words.index("--topic") + 1].removeprefix(PREFIX): words for words in asked}
    assert set(made) == set(TOPICS) and len(asked) == len(TOPICS)
    assert {words[words.index("--partitions") + 1] for words in asked} == {"7"}
    for topic, words in made.items():
        configs = {words[index + 1] for index, word in enumerate(words) if word == "--config"}
        kept = {"cleanup.policy=delete", f"retention.ms={5 * HOUR_MS}"} if topic in KEPT_FOR_A_WHILE else COMPACTED
        assert configs == kept | {"min.insync.replicas=2"}, topic
        assert "--if-not-exists" in words
    alone = asked_by("topics", REPLICATION="1")
    assert not any("min.insync.replicas=2" in words for words in alone), "one broker could never acknowledge"


def test_the_defaults_of_the_topics_are_those_that_the_programs_are_configured_with() -> None:
    text = (FOLDER / "kafka.toml").read_text()
    words = asked_by("topics")[0]
    for key, name in (("partitions", "--partitions"), ("replication_factor", "--replication-factor")):
        assert re.search(rf"^{key} = {words[words.index(name) + 1]}$", text, re.M)
    (hours,) = re.findall(r"^retention_hours = ([\d.]+)$", text, re.M)
    assert f"retention.ms={float(hours) * HOUR_MS:.0f}" in words


@pytest.mark.parametrize("script", ["acls", "topics"])
def test_without_an_address_a_script_says_how_it_is_used(script: str) -> None:
    done = subprocess.run(["bash", str(FOLDER / script)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"deploy/kafka/{script} --bootstrap-server" in done.stderr
