"""Addresses of brokers, which never show a secret."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.broker import BrokerAddress
from sparkplug.errors import BrokerAddressError


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("mqtt://127.0.0.1", BrokerAddress("127.0.0.1", 1883)),
        ("mqtt://127.0.0.1:2883/", BrokerAddress("127.0.0.1", 2883)),
        ("mqtts://plant.example", BrokerAddress("plant.example", 8883, tls=True)),
        ("MQTT://Plant.example", BrokerAddress("plant.example", 1883)),
        ("mqtt://edge%201@plant.example", BrokerAddress("plant.example", 1883, username="edge 1")),
        ("mqtt://[::1]:1884", BrokerAddress("::1", 1884)),
        ("mqtt://plant.example?version=5", BrokerAddress("plant.example", 1883, mqtt_version=5)),
        (
            "mqtts://plant.example?ca_file=/etc/ca.pem&certificate_file=c.pem&key_file=k.pem",
            BrokerAddress(
                "plant.example",
                8883,
                tls=True,
                ca_file=Path("/etc/ca.pem"),
                certificate_file=Path("c.pem"),
                key_file=Path("k.pem"),
            ),
        ),
    ],
)
def test_an_address_is_read(text: str, address: BrokerAddress) -> None:
    assert BrokerAddress.from_url(text) == address


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not mqtt://"),
        ("127.0.0.1:1883", "is not mqtt://"),
        ("http://127.0.0.1", "is not mqtt://"),
        ("mqtt://", "is not mqtt://"),
        ("mqtt://host/path", "is not mqtt://"),
        ("mqtt://host?x=1", "version=3.1.1"),
        ("mqtt://host?version=6", "version=3.1.1"),
        ("mqtt://host?ca_file=/etc/ca.pem", "need mqtts://"),
        ("mqtt://user:secret@host/path", "must hold no password"),
        ("mqtt://user:secret@host:port", "mqtt://user:…@host"),
        ("http://user:secret@host", "must hold no password"),
        ("mqtt://host:port", "port"),
        ("mqtt://host:99999", "[Pp]ort"),
        ("mqtt://user:secret@host", "must hold no password"),
        ("mqtt://user:@host", "must hold no password"),
    ],
)
def test_what_is_no_address_is_refused(text: str, says: str) -> None:
    with pytest.raises(BrokerAddressError, match=says) as caught:
        BrokerAddress.from_url(text)
    assert "secret" not in str(caught.value)


@given(st.text(max_size=30) | st.text(max_size=20).map("mqtt://".__add__))
def test_any_text_is_an_address_or_a_broker_address_error(text: str) -> None:
    try:
        address = BrokerAddress.from_url(text)
    except BrokerAddressError:
        return
    assert BrokerAddress.from_url(address.url) == address


@pytest.mark.parametrize(
    "text", ["mqtt://a.example:1883", "mqtts://edge@a.example:8883", "mqtt://e%40x@a.example:1", "mqtt://[::1]:7"]
)
def test_the_url_is_read_back_as_the_same_address(text: str) -> None:
    address = BrokerAddress.from_url(text)
    assert BrokerAddress.from_url(address.url) == address


def test_a_password_is_never_shown() -> None:
    address = BrokerAddress("a.example", username="edge").with_password("hunter2")
    assert address.password == "hunter2"
    assert "hunter2" not in f"{address!r} {address} {address.url}"
