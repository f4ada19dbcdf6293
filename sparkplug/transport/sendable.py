"""The messages that can be sent at all: by MQTT (3.1.1 and 5.0, 1.5.4 and 4.7), by what brokers take, and by what this one takes.

A broker ends the connection of whoever sends it another one, and with it the messages of everybody on that connection.
"""

import logging
import math
import time

from sparkplug.actions import Publish

TOPIC_BYTES_MAX = 65_535
LEVELS_MAX = 200  # Mosquitto's
PACKET_BYTES_MAX = 268_435_455 + 5  # the longest remaining length, and the header before it
HEADER_BYTES_MAX = 16  # of a PUBLISH beside its topic and payload: header, length, packet id, no properties
SHOWN_MAX = 60  # characters of a topic in a message for people
TOLD_S = 10.0  # between two lines of the log
_log = logging.getLogger(__name__)


class Sendable:
    """The bounds of one connection, and the count of the messages that were dropped for them.

    packet_bytes_max: what the broker takes; only one of MQTT 5 says it (3.2.2.3.6)
    """

    def __init__(self, client_id: str) -> None:
        self.unsendable = 0
        self.packet_bytes_max = PACKET_BYTES_MAX
        self._client_id = client_id
        self._told_s = -math.inf

    def takes(self, message: Publish) -> bool:
        """Return True if a message can be sent; one that cannot is counted, and logged."""
        fault = topic_fault(message.topic)
        if not fault:
            size = len(message.topic.encode()) + len(message.payload) + HEADER_BYTES_MAX
            if self.holds(message.topic, size):
                return True
        else:
            self.drop(message.topic, fault)
        return False

    def holds(self, topic: str, size: int) -> bool:
        """Return True if the broker takes a packet of so many bytes; one that it does not take is counted, and logged."""
        if size <= self.packet_bytes_max:
            return True
        self.drop(topic, f"a packet of {size} bytes; the broker takes {self.packet_bytes_max}")
        return False

    def drop(self, topic: str, fault: str) -> None:
        """Count a message that cannot be sent; many of them are a line now and then."""
        self.unsendable += 1
        now_s = time.monotonic()
        if now_s - self._told_s >= TOLD_S:
            self._told_s = now_s
            reason = f"a message on {shortened(topic)} cannot be sent and is dropped, {self.unsendable} so far: {fault}"
            _log.warning("%s: %s", self._client_id, reason)


def topic_fault(topic: str) -> str:
    """Return why nothing can be published on a topic; empty where a message can.

    >>> topic_fault("cnc/okuma/spindle_rpm"), topic_fault("cnc/+"), topic_fault("cnc/a" + chr(7))
    ('', "it holds a wildcard, '+' or '#'", 'it holds U+0007, which brokers refuse')
    """
    try:
        size = len(topic.encode())
    except UnicodeEncodeError:
        return "it is no UTF-8"
    if not topic:
        return "it is empty"
    if size > TOPIC_BYTES_MAX:
        return f"it has {size} bytes; MQTT takes {TOPIC_BYTES_MAX}"
    if "+" in topic or "#" in topic:
        return "it holds a wildcard, '+' or '#'"
    if topic.count("/") >= LEVELS_MAX:
        return f"it has {topic.count('/') + 1} levels; brokers take {LEVELS_MAX}"
    if not topic.isprintable():  # else no control character is in it, and no non-character
        refused = next((character for character in topic if _is_refused(ord(character))), None)
        if refused is not None:
            return f"it holds U+{ord(refused):04X}, which brokers refuse"
    return ""


def _is_refused(code: int) -> bool:
    """Return True for a control character or a non-character (1.5.4-2 leaves it to the broker; Mosquitto disconnects)."""
    return code < 0x20 or 0x7F <= code < 0xA0 or 0xFDD0 <= code <= 0xFDEF or code & 0xFFFE == 0xFFFE


def shortened(topic: str) -> str:
    """Return a topic as people are shown it: printable, and not too long.

    >>> shortened("cnc/" + "%25" * 30_000)
    "'cnc/%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%2…' (90004 characters)"
    """
    if len(topic) <= SHOWN_MAX:
        return ascii(topic)
    return f"{ascii(topic[:SHOWN_MAX])[:-1]}…' ({len(topic)} characters)"
