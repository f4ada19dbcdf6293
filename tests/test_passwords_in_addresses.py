"""A password in an address is never repeated: not in an error, whichever door the address is for and however it is wrong."""

import itertools
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from cnctwin.errors import ApplicationError
from cnctwin.jobs.dask_cluster import DaskCluster
from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.opening import open_store
from edge.check import discover
from edge.config_file import load
from edge.errors import EdgeError
from processors.errors import ProcessorError
from processors.running.runtime import configured
from sparkplug.broker import BrokerAddress
from sparkplug.errors import BrokerAddressError

SECRET = "hunter2"
FORMS = (
    "{scheme}://h?password={secret}",
    "{scheme}://h:1?version=5&pass={secret}",
    "{scheme}://h?{secret}",
    "{scheme}://h#{secret}",
    "{scheme}://user:{secret}@h",
    "{scheme}://user:{secret}@h:1",
    "{scheme}://user:x/{secret}@h",
    "{scheme}://user:x@{secret}@h",
    "{scheme}://user:{secret}@h:port",
    "{scheme}://user:{secret}@[::1",
    "{scheme}://:{secret}@h",
    "{scheme}://user:{secret}",
    "{scheme}://user:%00{secret}@h/path",
)
REFUSED = (ApplicationError, EdgeError, ProcessorError, BrokerAddressError, StoreError)


def addresses(*schemes: str) -> list[str]:
    return [form.format(scheme=scheme, secret=SECRET) for scheme, form in itertools.product(schemes, FORMS)]


def refusal(read: Callable[[], object]) -> str:
    with pytest.raises(REFUSED) as refused:
        read()
    text = str(refused.value)
    assert SECRET not in text
    assert "\n" not in text
    return text


@pytest.mark.parametrize("url", addresses("mqtt", "mqtts", "http"))
def test_a_brokers_address(url: str) -> None:
    refusal(lambda: BrokerAddress.from_url(url))


def test_it_says_where_a_password_belongs() -> None:
    for url in (f"mqtt://h?password={SECRET}", f"mqtt://u:{SECRET}@h"):
        assert "put it into an environment variable or a file" in refusal(partial(BrokerAddress.from_url, url))


@pytest.mark.parametrize("url", addresses("focas", "lsv2", "opc.tcp", "ftp"))
def test_the_address_of_a_control_that_is_looked_at(url: str) -> None:
    refusal(lambda: discover(url))


@pytest.mark.parametrize("url", addresses("http", "https"))
def test_the_address_of_an_agent_that_is_looked_at(url: str) -> None:
    refusal(lambda: discover(url))


@pytest.mark.parametrize(
    ("adapter", "table", "scheme"),
    [
        ("mtconnect", "mtconnect", "http"),
        ("mtconnect", "broker", "mqtt"),
        ("mtconnect", "accelerometer", "tcp"),
        ("opcua", "opcua", "opc.tcp"),
        ("heidenhain", "heidenhain", "lsv2"),
    ],
)
def test_an_address_in_the_file_of_an_edge(adapter: str, table: str, scheme: str, tmp_path: Path) -> None:
    from edge.running.run import broker_addresses

    for url in addresses(scheme):
        if scheme == "tcp" and url.endswith(f"h:1?version=5&pass={SECRET}"):
            continue  # host and port are there, and nothing of the rest is used or shown
        file = tmp_path / "edge.toml"
        file.write_text(f'[machine]\nname = "vmc"\nadapter = "{adapter}"\n[{table}]\nurl = "{url}"\n')

        def read(file: Path = file) -> None:
            config = load(file)
            broker_addresses(config.broker, config.path)

        refusal(read)


@pytest.mark.parametrize("url", addresses("https", "http"))
def test_the_address_of_a_receiver_of_alerts(url: str, tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text(f'[alerts.receivers.shop]\ntype = "webhook"\nurl = "{url}"\n')
    if "?" in url or "@" in url:
        refusal(lambda: configured(["alerts"], file))


@pytest.mark.parametrize("url", addresses("influx+https", "victoriametrics+http", "postgres"))
def test_the_address_of_a_store(url: str) -> None:
    refusal(lambda: open_store(url))


@pytest.mark.parametrize("url", addresses("tcp", "tls"))
def test_the_address_of_a_cluster(url: str) -> None:
    if "#" not in url:
        refusal(lambda: DaskCluster.from_text(url))


@pytest.mark.parametrize("command", [["doctor"], ["watch"], ["process", "mirror"], ["edge", "run", "x.toml"], ["jobs", "list"]])
def test_the_commands_and_their_help(command: list[str], tmp_path: Path) -> None:
    environment = {**os.environ, "CNCTWIN_BROKER": f"mqtt://h?password={SECRET}", "CNCTWIN_PASSWORD": SECRET}
    (tmp_path / "x.toml").write_text('[machine]\nname = "vmc"\nadapter = "mtconnect"\n')
    for arguments in (command, [*command, "--help"]):
        done = subprocess.run(
            [sys.executable, "-m", "cnctwin", *arguments],
            env=environment,
            cwd=tmp_path,
            check=False,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert SECRET not in done.stdout + done.stderr
        assert done.returncode == (0 if "--help" in arguments else 2), done.stderr
