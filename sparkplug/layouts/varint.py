"""Base-128 varints of protobuf, read and written.

>>> written(1_790_000_000_000).hex()
'80d8c1a28c34'
>>> number(bytes.fromhex("80d8c1a28c34"))
1790000000000
"""

REMEMBERED_MAX = 4096


class _Read(dict[bytes, int]):
    """The numbers of the last varints, by their bytes: the upper bytes of time stamps change once in 16 s."""

    def __missing__(self, raw: bytes) -> int:
        value = 0
        for byte in reversed(raw):
            value = value << 7 | byte & 127
        if len(self) >= REMEMBERED_MAX:
            self.clear()
        self[raw] = value
        return value


class _Written(dict[int, bytes]):
    """The bytes of the last numbers."""

    def __missing__(self, value: int) -> bytes:
        left, raw = value, bytearray()
        while left > 127:
            raw.append(left & 127 | 128)
            left >>= 7
        raw.append(left)
        if len(self) >= REMEMBERED_MAX:
            self.clear()
        data = self[value] = bytes(raw)
        return data


_READ, _WRITTEN = _Read(), _Written()
_LOWEST = [bytes((low & 127 | 128, low >> 7 | 128)) for low in range(1 << 14)]  # the first two bytes of a longer varint


def number(raw: bytes) -> int:
    """Return the number behind the bytes of one varint; the caller knows that they are one."""
    if len(raw) < 3:
        return _READ[raw]
    return raw[0] & 127 | (raw[1] & 127) << 7 | _READ[raw[2:]] << 14


def written(value: int) -> bytes:
    """Return the shortest varint of a number that is not negative."""
    if value < 16384:
        return _WRITTEN[value]
    return _LOWEST[value & 16383] + _WRITTEN[value >> 14]
