"""The order that a worker of an engine is started with: broker, topics, name, size of state."""

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields


@dataclass(frozen=True, slots=True)
class Order:
    """The command line of a worker; every engine takes the same one and leaves out what it does not need.

    >>> order = Order("127.0.0.1:9092", "in", "out", "snapshots", "group", "a", "/tmp/a", 200, 0.2, "at-least-once", "")
    >>> Order.read(order.words()) == order
    True
    """

    kafka: str
    inputs: str
    outputs: str
    snapshots: str
    group: str
    member: str
    state_dir: str
    state_bytes: int
    commit_s: float
    mode: str
    jar: str

    def words(self) -> list[str]:
        """Return the order as words of a command."""
        return [word for name, value in asdict(self).items() for word in (f"--{name}", str(value))]

    @classmethod
    def read(cls, words: Sequence[str] | None = None) -> "Order":
        """Return the order that a command gives."""
        parser = argparse.ArgumentParser()
        kinds = {"state_bytes": int, "commit_s": float}
        for one in fields(cls):
            parser.add_argument(f"--{one.name}", required=True, type=kinds.get(one.name, str))
        return cls(**vars(parser.parse_args(words)))
