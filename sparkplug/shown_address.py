"""Addresses as they may be shown: in an error, a log or a person's terminal, and never with what may be a secret."""

import re
from collections.abc import Collection

_PASSWORD = re.compile(r"(//[^/@:\s]*):\S*@")
_NO_PORT = re.compile(r"(//[^/@:\s\[]*):(?!\d{1,5}(?:[/?#'\"\s]|$))[^/?#'\"@\s]+")  # a password whose @host was forgotten
_BEHIND = re.compile(r"[?#][^\s'\"]*")


def shown_address(text: str, harmless: Collection[str] = ()) -> str:
    """Return a text with the secrets of the addresses in it left out: a password, and all that stands behind ? or #.

    harmless: names of options whose values may be shown

    >>> shown_address("mqtt://edge-1:hunter2@broker?version=5&password=x", {"version"})
    'mqtt://edge-1:…@broker?version=5&password=…'
    >>> shown_address("http://maintenance:hun/ter@2@agent:5000/probe#s3cret")
    'http://maintenance:…@agent:5000/probe#…'
    >>> shown_address("mqtt://edge-1:hunter2"), shown_address("mqtt://[::1]:1883"), shown_address("mqtt://h:1883/x")
    ('mqtt://edge-1:…', 'mqtt://[::1]:1883', 'mqtt://h:1883/x')
    """
    bare = _NO_PORT.sub(r"\1:…", _PASSWORD.sub(r"\1:…@", text))
    return _BEHIND.sub(lambda found: _shown_options(found[0], harmless), bare)


def _shown_options(text: str, harmless: Collection[str]) -> str:
    options = (option.partition("=") for option in text[1:].split("&") if option)
    return text[0] + "&".join(
        name + equals + value if equals and name in harmless else f"{name if equals else ''}{equals}…"
        for name, equals, value in options
    )
