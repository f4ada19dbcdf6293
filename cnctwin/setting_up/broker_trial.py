"""A broker, tried: does it let us in?"""

import logging
import time
from uuid import uuid4

from cnctwin.errors import UsageError
from sparkplug.broker import BrokerAddress
from sparkplug.errors import SparkplugError
from sparkplug.host import HostApplication

CONNECT_S_MAX = 10.0
TRIED_AFTER_S = 2.0
"""Longer than the first pause between two attempts: an error that stands then is no hiccup."""


def try_broker(broker: BrokerAddress) -> None:
    """Connect and disconnect, under a name of chance. Raises UsageError with what the broker says."""
    logger = logging.getLogger("sparkplug")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # what is wrong stands in the answer
    try:
        host = HostApplication(broker, f"init-{uuid4().hex[:12]}", (), publish_state=False)
        host.start()
        began_s = time.monotonic()
        try:
            while not host.online:
                host.poll(0.05)
                waited_s = time.monotonic() - began_s
                if waited_s > CONNECT_S_MAX or (host.last_error and waited_s > TRIED_AFTER_S):
                    error = host.last_error or f"no answer in {CONNECT_S_MAX:g} s"
                    raise UsageError(error if broker.url in error else f"{broker.url}: {error}")
        finally:
            host.stop(1.0)
    except SparkplugError as error:
        raise UsageError(str(error)) from None
    finally:
        logger.setLevel(level)
