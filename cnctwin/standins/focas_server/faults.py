"""Faults of a control's FOCAS server, to be switched on and off while it runs."""

import random
from dataclasses import dataclass, field
from enum import Enum

from cnctwin.standins.focas_server.frames import HEADER_BYTES, FrameType


class Refusal(Enum):
    """The ways a client is turned away: the connection is closed at once, or the session is answered with "all in use"."""

    CONNECTION = "connection"
    SESSION = "session"


class Wrong(Enum):
    """The ways an answer can be wrong. A wrong figure in a right frame is not among them: nobody could know."""

    GARBAGE = "garbage"  # as many bytes, none of them right
    SYNC = "sync"  # the first bytes are not those of a frame
    TYPE = "type"  # it is the answer to something else
    TOO_LONG = "too long"  # it says more bytes than come
    TOO_SHORT = "too short"  # it says fewer bytes than come, so what follows is out of step
    BLOCK_LENGTH = "block length"  # a block says another length than it has
    COUNT = "count"  # one block more than there are
    COMMAND = "command"  # a block that nobody asked for
    SWAPPED = "swapped"  # the first block comes last
    CODES = "codes"  # every block is refused, with codes of all kinds


CODES = (-17, -16, -9, -8, -7, -6, -5, -4, -3, -2, -1, 2, 3, 4, 5, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17, 99)


@dataclass
class Faults:
    """The switches; set them from any thread.

    hang: requests are taken and not answered; what was asked meanwhile is answered afterwards, as a process does that was stopped
    delay_s: every answer is so late
    refusal: new clients are turned away; those that are there stay
    drop_after_bytes: so much of an answer is sent, then the connection breaks
    wrong: answers to commands are spoiled in this way
    failing: functions (class, command) that are answered with a code
    """

    hang: bool = False
    delay_s: float = 0.0
    refusal: Refusal | None = None
    drop_after_bytes: int | None = None
    wrong: Wrong | None = None
    failing: dict[tuple[int, int], int] = field(default_factory=dict)

    def clear(self) -> None:
        """All is well again."""
        self.hang, self.delay_s, self.refusal, self.drop_after_bytes, self.wrong = False, 0.0, None, None, None
        self.failing = {}


def spoiled(raw: bytes, wrong: Wrong, chance: random.Random) -> bytes:
    """An answer (header, number of blocks, blocks) with this fault.

    >>> whole = bytes.fromhex("a0a0a0a00004210200120001" "00100001000100250000000000000000")
    >>> spoiled(whole, Wrong.TOO_LONG, random.Random(0)).hex()[:20], spoiled(whole, Wrong.COUNT, random.Random(0)).hex()[20:24]
    ('a0a0a0a0000421020019', '0002')
    """
    edited, first = bytearray(raw), HEADER_BYTES + 2
    length = int.from_bytes(raw[first : first + 2], "big")
    if wrong is Wrong.GARBAGE:
        return chance.randbytes(len(raw))
    if wrong is Wrong.SYNC:
        edited[0:4] = b"\xa0\xa0\x0a\xa0"
    elif wrong is Wrong.TYPE:
        edited[6:8] = FrameType.CLOSED.to_bytes(2, "big")
    elif wrong in (Wrong.TOO_LONG, Wrong.TOO_SHORT):
        off = 7 if wrong is Wrong.TOO_LONG else -3
        edited[8:10] = (len(raw) - HEADER_BYTES + off).to_bytes(2, "big")
    elif wrong is Wrong.BLOCK_LENGTH:
        edited[first : first + 2] = (length + chance.choice((-9, -1, 1, 8, 4000))).to_bytes(2, "big")
    elif wrong is Wrong.COUNT:
        edited[first - 2 : first] = (int.from_bytes(raw[first - 2 : first], "big") + 1).to_bytes(2, "big")
    elif wrong is Wrong.COMMAND:
        edited[first + 6 : first + 8] = b"\x7f\x7f"
    elif wrong is Wrong.SWAPPED:
        edited[first:] = edited[first + length :] + edited[first : first + length]
    else:
        _refuse_all(edited, first, chance)
    return bytes(edited)


def _refuse_all(edited: bytearray, at: int, chance: random.Random) -> None:
    """Each block becomes a refusal; the data goes, as it does in a control."""
    blocks: list[bytes] = []
    while at < len(edited):
        length = int.from_bytes(edited[at : at + 2], "big")
        code = chance.choice(CODES).to_bytes(2, "big", signed=True)
        blocks.append(b"\x00\x10" + edited[at + 2 : at + 8] + code + bytes(6))
        at += length
    edited[HEADER_BYTES + 2 :] = b"".join(blocks)
    edited[8:10] = (len(edited) - HEADER_BYTES).to_bytes(2, "big")
