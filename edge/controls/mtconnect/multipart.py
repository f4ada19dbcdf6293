"""The parts of a multipart stream, fed with bytes as they come (RFC 2046, 5.1; both x-mixed-replace and mixed).

A part is delivered when it is complete: by its Content-length where it has one, else by the next delimiter. Anything else between
parts than line breaks is an error, because then bytes were lost and the reader is no longer in step.

>>> parser = MultipartParser("multipart/x-mixed-replace;boundary=b")
>>> parser.feed(b"--b\\r\\nContent-length: 4\\r\\n\\r\\n<a/>\\r\\n--b")
[b'<a/>']
"""

import re

from edge.errors import ConnectionLostError

HEAD_BYTES_MAX = 16 * 1024
PART_BYTES_MAX = 64 * 1024 * 1024
_BOUNDARY = re.compile(r"""boundary\s*=\s*(?:"([^"]+)"|([^\s;"]+))""", re.IGNORECASE)
_HEAD_END = re.compile(rb"\r?\n\r?\n")
_LENGTH = re.compile(rb"^content-length\s*:\s*(\d{1,12})\s*$", re.IGNORECASE | re.MULTILINE)


class MultipartParser:
    """Bytes in, whole parts out."""

    def __init__(self, content_type: str, part_bytes_max: int = PART_BYTES_MAX) -> None:
        found = _BOUNDARY.search(content_type)
        if found is None:
            raise ConnectionLostError(f"multipart stream without a boundary: {content_type!r}")
        self._delimiter = b"--" + (found.group(1) or found.group(2)).encode("latin-1", "replace")
        self._part_bytes_max = part_bytes_max
        self._buffer = bytearray()
        self._in_part = False
        self._is_first = True
        self._length: int | None = None
        self._searched = 0  # up to here there is no delimiter in the buffer
        self.closed = False

    def feed(self, data: bytes) -> list[bytes]:
        """The parts that these bytes complete; ConnectionLostError where the stream is no multipart stream."""
        self._buffer += data
        parts: list[bytes] = []
        while not self.closed:
            if not self._in_part:
                if not self._head():
                    break
            elif (part := self._body()) is not None:
                parts.append(part)
            else:
                break
        return parts

    def _head(self) -> bool:
        at = self._buffer.find(self._delimiter)
        if at < 0:
            self._stay_in_step(bytes(self._buffer[: -len(self._delimiter)] if self._is_first else b""))
            if len(self._buffer) > HEAD_BYTES_MAX:
                raise ConnectionLostError(f"no part begins within {HEAD_BYTES_MAX} bytes")
            return False
        self._stay_in_step(bytes(self._buffer[:at]))
        after = at + len(self._delimiter)
        if self._buffer[after : after + 2] == b"--":
            self.closed = True
            return False
        end = _HEAD_END.search(self._buffer, after)
        if end is None:
            if len(self._buffer) - after > HEAD_BYTES_MAX:
                raise ConnectionLostError(f"the head of a part is longer than {HEAD_BYTES_MAX} bytes")
            return False
        head = bytes(self._buffer[after : end.start()])
        if head.partition(b"\n")[0].strip() or self._delimiter in head:
            raise ConnectionLostError(f"out of step: {head[:40]!r} behind a delimiter")
        length = _LENGTH.search(head.replace(b"\r", b""))
        self._length = None if length is None else int(length.group(1))
        if self._length is not None and self._length > self._part_bytes_max:
            raise ConnectionLostError(f"part of {self._length} bytes; the most that is read is {self._part_bytes_max}")
        del self._buffer[: end.end()]
        self._in_part, self._is_first = True, False
        return True

    def _stay_in_step(self, between: bytes) -> None:
        if between.strip() and not self._is_first:
            raise ConnectionLostError(f"out of step: {between[:40]!r} where a delimiter should be")

    def _body(self) -> bytes | None:
        length = self._length
        if length is None:
            length = self._buffer.find(b"\n" + self._delimiter, self._searched)
            if length < 0:
                self._searched = max(len(self._buffer) - len(self._delimiter), 0)
                if len(self._buffer) > self._part_bytes_max:
                    raise ConnectionLostError(f"part of more than {self._part_bytes_max} bytes")
                return None
            if self._buffer[length - 1 : length] == b"\r":
                length -= 1
        elif len(self._buffer) < length:
            return None
        part = bytes(self._buffer[:length])
        del self._buffer[:length]
        self._in_part, self._searched = False, 0
        return part
