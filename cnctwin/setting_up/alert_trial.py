"""A receiver of alerts, tried: the same test that `cnctwin alerts test` sends, without broker and processors."""

import time
import tomllib
from collections.abc import Mapping
from typing import Any
from uuid import uuid4

from cnctwin.errors import UsageError
from processors.alerts.body import Notice
from processors.alerts.config import AlertsConfig
from processors.alerts.courier.outcome import Verdict
from processors.alerts.courier.service import service_of
from processors.alerts.notification import Notification, written
from processors.alerts.processor import PROCESSOR
from processors.errors import ConfigurationError

EXPIRES_S = 60.0


def send_test(processors_toml: str, receiver: str, environment: Mapping[str, str]) -> None:
    """Send a test to a receiver of this configuration. Raises UsageError where it is not delivered."""
    table: dict[str, Any] = tomllib.loads(processors_toml).get("alerts", {})
    try:
        configuration = PROCESSOR.configured(table)
        assert isinstance(configuration.default, AlertsConfig)
        service = service_of(receiver, configuration.default.receivers[receiver], environment)
        notice = Notice(receiver, "test", "test", {}, (), (f"test.{uuid4().hex[:16]}",), ("cnctwin init",), EXPIRES_S)
        wall_s = time.time()
        outcome = service.send(Notification.of(written(uuid4().hex[:16], notice, configuration, wall_s, wall_s)))
    except ConfigurationError as error:
        raise UsageError(str(error)) from None
    if outcome.verdict is not Verdict.DELIVERED:
        raise UsageError(f"the test was not delivered: {outcome.verdict.value}: {outcome.reason}")
