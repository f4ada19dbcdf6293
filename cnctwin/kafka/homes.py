"""The partition in which a key is at home, as Kafka's clients compute it: murmur2, as librdkafka's `murmur2_random` and Java.

Records with a key find their partition by themselves. Who reads partitions has to know it of a cell that there is before any of
its records came.
"""

from collections.abc import Callable

SEED, FACTOR, SHIFT = 0x9747B28C, 0x5BD1E995, 24
BITS_32, BITS_31 = 0xFFFF_FFFF, 0x7FFF_FFFF


def home_of(key: str, partitions: int) -> int:
    """Return the number of the partition of a key.

    >>> [home_of(key, 12) for key in ("all", "mill-7")]
    [0, 5]
    """
    return (_murmur2(key.encode()) & BITS_31) % partitions


def home_in(number: int, partitions: int) -> Callable[[str], bool]:
    """Return what says of a key whether it is at home in the partition of this number."""
    return lambda key: home_of(key, partitions) == number


def _murmur2(content: bytes) -> int:
    """Return the hash of 32 bits by MurmurHash 2 of Austin Appleby, with the seed that Kafka takes."""
    told = SEED ^ len(content)
    whole = len(content) // 4 * 4
    for begin in range(0, whole, 4):
        word = int.from_bytes(content[begin : begin + 4], "little") * FACTOR & BITS_32
        word = (word ^ word >> SHIFT) * FACTOR & BITS_32
        told = told * FACTOR & BITS_32 ^ word
    if rest := content[whole:]:
        told = (told ^ int.from_bytes(rest, "little")) * FACTOR & BITS_32
    told = (told ^ told >> 13) * FACTOR & BITS_32
    return told ^ told >> 15
