"""Edges at work: that of a file, or those of a folder of files."""

import sys
import tomllib
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

from cnctwin.processes.given_broker import broker_or_own
from edge.config import EdgeConfig
from edge.config_file import load
from edge.errors import ConfigError
from edge.running.driver import Driver
from edge.running.gateway import Gateway
from edge.running.run import broker_addresses, edge_runtime
from edge.running.runtime import EdgeRuntime
from edge.state_dir import state_dir
from sparkplug.broker import BrokerAddress
from sparkplug.errors import SparkplugError


def run(path: Path, given: BrokerAddress | None, stop: Event) -> dict[str, int]:
    """Run the edge of this file, or those of a folder of files, until stopped; the last ledger, or the sum of them.

    `given` takes the place of the brokers in the files; where neither names one, one of our own is started.
    """
    files = sorted(path.glob("*.toml")) if path.is_dir() else [path]
    if not path.is_dir():
        load(path)  # what is wrong with it is said before a broker of our own is started
    needs_own = given is None and not all(map(_names_broker, files))
    with broker_or_own(given) if needs_own or given is not None else nullcontext() as broker:

        def begin(config: EdgeConfig[Any], restarts: int) -> EdgeRuntime:
            named = given is None and {"url", "urls"} & config.broker.model_fields_set  # the file may be in pieces by now
            brokers = broker_addresses(config.broker, config.path) if named or broker is None else (broker,)
            try:
                runtime = edge_runtime(_with_session_file(config), brokers, restarts=restarts, driver=driver)
            except SparkplugError as error:  # such as a certificate's file that is not there
                raise ConfigError(f"{config.path}: {error}") from error
            urls = ", ".join(address.url for address in brokers)
            print(f"{config.path}: the edge of {config.machine.name} begins, to {urls}", file=sys.stderr, flush=True)
            return runtime

        driver = Driver()
        driver.start()
        try:
            return Gateway(path, begin).run(stop)
        finally:
            driver.stop()


def _with_session_file(config: EdgeConfig[Any]) -> EdgeConfig[Any]:
    if config.broker.session_file:
        return config
    file = state_dir() / f"{config.broker.group}.{config.node}.json"
    return replace(config, broker=config.broker.model_copy(update={"session_file": str(file)}))


def _names_broker(path: Path) -> bool:
    with suppress(OSError, ValueError, AttributeError):
        return bool({"url", "urls"} & tomllib.loads(path.read_text()).get("broker", {}).keys())
    return False
