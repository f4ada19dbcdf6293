"""Up to a hundred MTConnect agents in one process, as light as they can be: what `benchmarks/edges/cost.py` has a gateway read.

    python -m benchmarks.edges.load 10        # documents a second of each; prints its port

Each streams documents of eight changed values, as /m00/…, /m01/…; a tool change each minute.
"""

import asyncio
import contextlib
import math
import sys
import time
from datetime import UTC, datetime

from tests.edge.controls.mtconnect.agent_documents import probe, streams, value

STAMP = b"2026-01-01T00:00:00Z"
TOOL_CHANGE_S, CHANGE_EACH_S = 4.0, 60.0


def stamp(at_s: float) -> str:
    """As agents write it."""
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def observations(machine: int, sequence: int, at_s: float, *, all_of_it: bool = False) -> list[str]:
    """Return what changed at this look."""
    told = stamp(at_s)
    turn = at_s + 7.0 * machine
    number = int(turn / CHANGE_EACH_S) % 20 + 1
    changing = turn % CHANGE_EACH_S < TOOL_CHANGE_S
    figures = {
        "xpos": f"{200 * math.sin(turn):.3f}",
        "xload": f"{abs(40 * math.cos(turn)):.1f}",
        "rpm": f"{8000 + 50 * math.sin(9 * turn):.0f}",
        "load": f"{30 + 10 * math.sin(5 * turn):.1f}",
        "temp": f"{30 + math.sin(turn / 50):.2f}",
        "feed": f"{50 + math.sin(turn):.3f}",
        "block": f"T{number} M6" if changing else f"N{sequence} G1 X{math.sin(turn):.3f}",
        "tool": "" if changing else str(number),
    }
    if all_of_it:
        figures |= {"avail": "AVAILABLE", "exec": "ACTIVE"}
    return [value(item, sequence + i, text, time=told) for i, (item, text) in enumerate(figures.items())]


class Agents:
    """All of them on one port."""

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.sequence: dict[int, int] = {}

    async def answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One client until it goes."""
        with contextlib.suppress(OSError, ValueError, asyncio.IncompleteReadError):
            while (request := await reader.readuntil(b"\r\n\r\n")) != b"":
                path = request.split()[1].decode()
                machine = int(path[2:4])
                if "/probe" in path:
                    self._send(writer, probe(buffer_size=100_000))
                elif "/current" in path:
                    sequence = self.sequence.setdefault(machine, 1)
                    self.sequence[machine] = sequence + 10
                    told = observations(machine, sequence, time.time(), all_of_it=True)
                    self._send(writer, streams(sequence + 10, told, buffer_size=100_000))
                else:
                    await self._stream(writer, machine)
                await writer.drain()
        writer.close()

    @staticmethod
    def _send(writer: asyncio.StreamWriter, body: bytes) -> None:
        body = body.replace(STAMP, stamp(time.time()).encode(), 1)
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n" % len(body) + body)

    async def _stream(self, writer: asyncio.StreamWriter, machine: int) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/mixed;boundary=b0\r\nConnection: close\r\n\r\n")
        due_s = time.monotonic() + machine * 0.002
        while True:
            due_s += 1.0 / self.rate_hz
            await asyncio.sleep(max(due_s - time.monotonic(), 0.0))
            sequence = self.sequence[machine]
            told = observations(machine, sequence, time.time())
            self.sequence[machine] = sequence + len(told)
            body = streams(sequence + len(told), told, buffer_size=100_000).replace(STAMP, stamp(time.time()).encode(), 1)
            writer.write(b"--b0\r\nContent-type: text/xml\r\nContent-length: %d\r\n\r\n" % len(body) + body + b"\r\n")
            await writer.drain()


async def serve(rate_hz: float) -> None:
    """Until killed."""
    server = await asyncio.start_server(Agents(rate_hz).answer, "127.0.0.1", 0, limit=65_536)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(serve(float(sys.argv[1])))
