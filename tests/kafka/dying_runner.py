"""A runner that is killed by -9 in one of its transactions: `GROUP MEMBER BOOTSTRAP PLACE TRANSACTION NAMES…`."""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from threading import Event
from typing import Any

from confluent_kafka import Consumer, TopicPartition

from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import settings_of
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import Transactions
from processors.running.runtime import configured

PLACES = ("produced", "offsets sent", "committed")


class _Dying(Transactions):
    place, countdown = "", 0

    def commit(self, positions: Sequence[TopicPartition], consumer: Consumer) -> None:
        """Commit, or die on the way."""
        _Dying.countdown -= 1
        if self.countdown == 0:
            self._producer.flush(30.0)
            if self.place == "produced":
                _die()
            self._insist_then_die(positions, consumer)
        super().commit(positions, consumer)
        if self.countdown == 0:
            _die()

    def _insist_then_die(self, positions: Sequence[TopicPartition], consumer: Consumer) -> None:
        if self.place == "offsets sent":
            self.open()
            self._producer.send_offsets_to_transaction(list(positions), consumer.consumer_group_metadata(), 30.0)
            _die()


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def main(group: str, member: str, bootstrap: str, place: str, transaction: str, *names: str) -> None:
    """Run until the transaction of that number."""
    from cnctwin.kafka import runner

    assert place in PLACES
    _Dying.place, _Dying.countdown = place, int(transaction)
    in_place: Callable[..., Any] = _Dying
    runner.Transactions = in_place  # type: ignore[misc,assignment]
    Runner(settings_of(bootstrap, None), Topics(group), configured(list(names), None), member).run(Event())


if __name__ == "__main__":
    main(*sys.argv[1:])
