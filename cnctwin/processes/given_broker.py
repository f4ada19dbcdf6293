"""The broker of a command: the one that is given, else one that answers on the default port, else one of our own."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from cnctwin.processes.private_broker import DEFAULT_PORT, PrivateBroker, answers
from sparkplug.broker import BrokerAddress

BROKER_VARIABLE = "CNCTWIN_BROKER"
PASSWORD_VARIABLE = "CNCTWIN_PASSWORD"  # noqa: S105 — the name of the variable, not a secret


def address(url: str | None) -> BrokerAddress | None:
    """The broker of `--broker` or the environment, with the password of the environment; None where none is given."""
    given = url or os.environ.get(BROKER_VARIABLE)
    return None if not given else BrokerAddress.from_url(given).with_password(os.environ.get(PASSWORD_VARIABLE))


@contextmanager
def broker_or_own(given: BrokerAddress | None) -> Iterator[BrokerAddress]:
    """The given broker; else one on 127.0.0.1:1883; else a private one, which ends with the command."""
    if given is not None:
        yield given
    elif answers("127.0.0.1", DEFAULT_PORT):
        print(f"no broker given: using the one on 127.0.0.1:{DEFAULT_PORT}", file=sys.stderr)
        yield BrokerAddress()
    else:
        with TemporaryDirectory(prefix="cnctwin-broker-") as folder:
            own = PrivateBroker(Path(folder), DEFAULT_PORT)
            own.start()
            print(f"no broker given: started a private one, {own.address.url} (loopback only)", file=sys.stderr)
            try:
                yield own.address
            finally:
                own.stop()
