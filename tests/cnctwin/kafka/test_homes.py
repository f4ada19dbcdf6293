"""The partition of a key: Kafka's own test vectors of its hash."""

import pytest

from cnctwin.kafka.homes import BITS_32, _murmur2, home_in, home_of

VECTORS = {
    "21": -973932308,
    "foobar": -790332482,
    "a-little-bit-long-string": -985981536,
    "a-little-bit-longer-string": -1486304829,
    "lkjh234lh9fiuh90y23oiuhsafujhadof229phr9h19h89h8": -58897971,
    "abc": 479470107,
}
"""Of org.apache.kafka.common.utils.UtilsTest."""


@pytest.mark.parametrize("key", VECTORS)
def test_the_hash_is_that_of_kafkas_clients(key: str) -> None:
    assert _murmur2(key.encode()) == VECTORS[key] & BITS_32


def test_each_key_is_at_home_in_one_partition() -> None:
    for key in (*VECTORS, "all", "", "fräse-7"):
        assert [number for number in range(12) if home_in(number, 12)(key)] == [home_of(key, 12)]
