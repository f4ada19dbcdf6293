"""The consumer groups of a plant, as the cluster lists them: other sets of runners, and other bridges."""

import time
from collections.abc import Sequence
from threading import Event

from confluent_kafka import ConsumerGroupState, ConsumerGroupTopicPartitions, KafkaException
from confluent_kafka.admin import AdminClient

from cnctwin.kafka.client_log import LOG
from cnctwin.kafka.kept import answered
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.errors import ConfigurationError

ANSWER_S = 10.0
AGAIN_S = 0.5
SESSIONS = 2.0  # for which the runners of a set that was just ended are waited for
_NOBODY = (ConsumerGroupState.EMPTY, ConsumerGroupState.DEAD)


def refuse_overlap(settings: KafkaSettings, topics: Topics, names: Sequence[str], stop: Event) -> None:
    """Raise ConfigurationError where a processor of this set runs in another one: both would publish, and save states of one
    name at different places of the log. Members of a set that ended in order are in it for `session_s` more."""
    admin, until_s = AdminClient(settings.client()), time.monotonic() + SESSIONS * settings.session_s
    while found := _overlapping(_groups(admin, topics.runners(()), are_live=True), topics, names):
        group, both = found
        if time.monotonic() > until_s:
            raise ConfigurationError(
                f"kafka: runners of {' and '.join(both)} run in the consumer group {group} as well; end them first"
            )
        if stop.wait(AGAIN_S):
            return


def _overlapping(groups: Sequence[str], topics: Topics, names: Sequence[str]) -> tuple[str, list[str]] | None:
    """Return a group of runners that shares processors with a set, and which; None where there is none."""
    own, prefix = topics.runners(names), topics.runners(())
    for group in groups:
        if group != own and (both := sorted(set(names) & set(group.removeprefix(prefix).split("+")))):
            return group, both
    return None


def published_up_to(settings: KafkaSettings, topics: Topics) -> dict[int, int]:
    """Return the offset, by partition, up to which any bridge has published results; nothing where no bridge ever has.

    Raises KafkaException.
    """
    admin = AdminClient(settings.client())
    furthest: dict[int, int] = {}
    for group in _groups(admin, topics.bridge(""), are_live=False):
        asked = admin.list_consumer_group_offsets([ConsumerGroupTopicPartitions(group)], request_timeout=ANSWER_S)
        for place in asked[group].result(ANSWER_S).topic_partitions or ():
            if place.topic == topics.results and place.offset >= 0:
                furthest[place.partition] = max(place.offset, furthest.get(place.partition, 0))
    return furthest


def _groups(admin: AdminClient, prefix: str, *, are_live: bool) -> list[str]:
    """Return the groups whose names begin with `prefix`; if `are_live`, only those with members. Empty if the cluster fails."""
    try:
        listed = answered(lambda: admin.list_consumer_groups(request_timeout=ANSWER_S).result(ANSWER_S), ANSWER_S).valid
    except KafkaException as error:
        LOG.warning("kafka: the consumer groups are not known: %s", error.args[0].str())
        return []
    return [one.group_id for one in listed if one.group_id.startswith(prefix) and not (are_live and one.state in _NOBODY)]
