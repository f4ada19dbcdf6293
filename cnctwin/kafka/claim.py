"""The claim of a runner's name, made before anything else is loaded.

The cluster takes up to half a second to end what the process before has left open. Meanwhile the rest of the program is loaded
and made ready, so this file imports little.
"""

from collections.abc import Sequence
from threading import Event

from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import Transactions
from processors.errors import ConfigurationError


def claim(settings: KafkaSettings, group: str, names: Sequence[str], member: str, stop: Event) -> Transactions:
    """Begin to claim the name of the runner `member` of these processors. Raises ConfigurationError for a member with a dot."""
    if "." in member:  # it stands behind the last dot of the transactional id
        raise ConfigurationError(f"--member {member!r} has a dot; give it a name without one")
    return Transactions(settings, Topics(group).writer(names, member), stop.is_set)
