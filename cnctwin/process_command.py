"""`cnctwin process`: processors at work, and beside `alerts` the courier that sends what its receivers are to be told."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from processors.runtime import Configured, run_configured
from sparkplug.broker import BrokerAddress


def process(pairs: Sequence[Configured], broker: BrokerAddress, stop: threading.Event, *, group: str, state_dir: Path) -> None:
    """Run configured processors until `stop` is set. Raises ConfigurationError where a secret is missing."""
    with _courier(pairs, broker, group):
        run_configured(pairs, broker, stop, group=group, session_dir=state_dir)


@contextmanager
def _courier(pairs: Sequence[Configured], broker: BrokerAddress, group: str) -> Iterator[None]:
    """The courier, where alerts run and somebody is to be told; else nothing, and httpx is not loaded."""
    from processors.alerts_config import AlertsConfig  # noqa: PLC0415  with the processor that needs it

    config = next((one.default for _, one in pairs if isinstance(one.default, AlertsConfig)), None)
    if config is None or not config.receivers:
        yield
        return
    from processors.courier.thread import Courier  # noqa: PLC0415

    courier = Courier(broker, config, group)
    courier.start()
    try:
        yield
    finally:
        courier.stop()
