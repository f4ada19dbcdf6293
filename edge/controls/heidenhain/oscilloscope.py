"""The oscilloscope of an iTNC 530 over LSV2: which signals it has, and packets of their values. Reading only; it moves nothing.

R_OC lists the signals, R_OP selects some and tells their units and factors, R_OD begins to record, and each T_OK asks for the
next packet: a number that counts packets, then 32 values of each signal. Value = factor · raw + offset. pyLSV2 decodes what
comes; its own `real_time_readings` leaves out the second packet, so the telegrams are asked for here.

A packet that is not fetched in time is lost, which its number shows. How the numbers count is not documented; their smallest step
is taken as one packet.
"""

import logging
import math
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from edge.controls.heidenhain.config import host_and_port
from edge.controls.heidenhain.control import library
from edge.controls.heidenhain.link import SCOPE_READS, ReadOnlyLink
from edge.errors import ConnectionLostError, EdgeError

INTERVALS_US = (600, 3000, 21_000)
VALUES = 32
"""Values of each signal in a packet."""
SIGNALS_MAX = 30
"""Beyond it a packet would be longer than the telegram that is agreed."""
LOGINS = ("INSPECT", "OSZI")
TOO_MANY = 85
DETAIL_BYTES = 22


def _detail(told: bytes) -> tuple[str, float, int]:
    """Return unit, factor and offset of a signal. pyLSV2 refuses factors below 2^-15 and from 2 on, so it is read here."""
    (factor,), (offset,) = struct.unpack_from("<d", told, 10), struct.unpack_from("!l", told, 18)
    return told[:10].decode("latin-1").replace("\x00", "").strip(), factor, offset


class ScopeError(EdgeError):
    """The oscilloscope cannot be used as asked, with the way out."""


class ScopeSignal(NamedTuple):
    """A signal that the control offers. name: as pyLSV2 normalises it, such as `x_s_actual`; interval_us: the smallest."""

    name: str
    label: str
    channel: str
    interval_us: int
    raw: Any


class Packet(NamedTuple):
    """32 values of each signal, in the order in which they were asked for."""

    number: int
    values: tuple[tuple[float, ...], ...]


class Oscilloscope:
    """An open connection to the oscilloscope. Every fault is an EdgeError in one line."""

    def __init__(
        self, url: str, *, password: str = "", timeout_s: float = 5.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._url, self._password, self._timeout_s = url, password, timeout_s
        self._pylsv2 = library()
        host, port = host_and_port(url)
        self._link = ReadOnlyLink(
            host, port, logins=LOGINS, patience_s=timeout_s, clock=clock, pylsv2=self._pylsv2, more_reads=SCOPE_READS
        )
        client: Any = self._pylsv2.LSV2("127.0.0.1", port=port, timeout=1.0, safe_mode=False)
        client._llcom.disconnect()
        client._llcom = self._link
        client._logger = logging.Logger("pyLSV2", logging.CRITICAL)
        client._known_logins = LOGINS
        client._known_sys_cmd = (3, 4, 5, 6, 7)
        self._client = client

    def open(self) -> None:
        """Connect and log in. Raises ScopeError where it is no iTNC 530, or where it refuses the log-in."""
        try:
            self._open()
        except ScopeError:
            self.close()
            raise

    def _open(self) -> None:
        self._link.begin(self._timeout_s)
        try:
            self._client.connect()
        except OSError as error:
            raise ScopeError(
                f"{self._url}: {error.strerror or error}; is the control on, and this port open (19000 where none is named)?"
            ) from None
        except ConnectionLostError as error:
            raise ScopeError(f"{self._url}: {error}") from None
        except Exception as error:
            raise ScopeError(f"{self._url}: the control does not introduce itself: {type(error).__name__}: {error}") from error
        versions = self._client.versions
        if not versions.is_itnc():
            raise ScopeError(
                f"{self._url} is a {versions.control}, whose oscilloscope LSV2 does not show; only the iTNC 530 has it: "
                "save a TNCscope recording as text and give it to `cnctwin import`"
            )
        if not self._client.login(self._pylsv2.const.Login.SCOPE, self._password):
            how = "the password is not right" if self._password else "it takes a password: name its variable with --password-env"
            raise ScopeError(f"{self._url}: the control refuses the log-in OSZI ({self._code()}); external access on? {how}")

    def close(self) -> None:
        """Close the connection."""
        self._link.disconnect()

    @property
    def control(self) -> str:
        """Return what the control calls itself."""
        versions = self._client.versions
        return f"{versions.control} {versions.nc_sw}".strip()

    def signals(self) -> tuple[ScopeSignal, ...]:
        """Return the signals that the control offers. Raises ScopeError."""
        self._link.begin(self._timeout_s)
        try:
            found = self._client.read_scope_signals()
        except ConnectionLostError as error:
            raise ScopeError(f"{self._url}: {error}") from None
        except Exception as error:  # whatever pyLSV2 makes of a description that it cannot read
            raise ScopeError(f"{self._url}: its list of signals cannot be read: {type(error).__name__}: {error}") from error
        return tuple(
            ScopeSignal(one.normalized_name(), one.signal_name, one.channel_name, one.min_interval, one)
            for one in found
            if one.signal_name or one.channel_type == self._pylsv2.const.ChannelType.TYPE0
        )

    def select(self, signals: Sequence[ScopeSignal], interval_us: int) -> tuple[str, ...]:
        """Say what is to be recorded, and return the unit of each. Raises ScopeError."""
        if interval_us not in INTERVALS_US:
            raise ScopeError(f"--interval {interval_us} is none of {', '.join(map(str, INTERVALS_US))} µs")
        if len(signals) > SIGNALS_MAX:
            raise ScopeError(f"{len(signals)} signals are more than the {SIGNALS_MAX} that fit a telegram; name fewer")
        if slow := next((one for one in signals if one.interval_us > interval_us), None):
            raise ScopeError(f"{slow.name} comes every {slow.interval_us} µs at best; --interval {interval_us} asks for more")
        self._link.begin(self._timeout_s)
        chosen = [one.raw for one in signals]
        payload = struct.pack("!L", interval_us) + b"".join(bytes(one.to_ba()) for one in chosen)
        told = self._asked("R_OP", payload)
        if len(told) != DETAIL_BYTES * len(chosen):
            raise ScopeError(f"{self._url}: describes {len(chosen)} signals in {len(told)} bytes; {DETAIL_BYTES} each are known")
        for at, one in enumerate(chosen):
            text, one.factor, one.offset = _detail(bytes(told[at * DETAIL_BYTES : (at + 1) * DETAIL_BYTES]))
            one.unit = text
            if not math.isfinite(one.factor) or one.factor == 0.0:
                raise ScopeError(f"{self._url}: gives {signals[at].name} the factor {one.factor:g}; its values mean nothing")
        return tuple(one.unit for one in chosen)

    def packets(self, signals: Sequence[ScopeSignal], interval_us: int) -> Iterator[Packet]:
        """Yield packets until the caller stops. Raises ScopeError where the control stops first."""
        chosen = [one.raw for one in signals]
        wait_s = self._timeout_s + 2 * VALUES * interval_us / 1e6
        self._link.begin(wait_s)
        told = self._asked("R_OD", struct.pack("!HHLLL", 6, 65535, 0, 0, interval_us))
        while True:
            try:
                reading = self._pylsv2.misc_scope.decode_scope_reading(chosen, told)
            except Exception as error:
                raise ScopeError(f"{self._url}: a packet cannot be read: {type(error).__name__}: {error}") from error
            yield Packet(
                int(reading.seqence_nr()),
                tuple(tuple(one.factor * raw + one.offset for raw in one.data) for one in reading.get_data()),
            )
            self._link.begin(wait_s)
            told = self._asked("T_OK", b"")

    def _asked(self, word: str, payload: bytes) -> bytearray:
        try:
            told = self._link.telegram(word, payload)
        except ConnectionLostError as error:
            raise ScopeError(f"{self._url}: {error}") from None
        answer = self._link.last_response.value
        if answer in ("T_ER", "T_BD"):
            code = int(self._link.last_error.e_code)
            why = "too many signals at once: name fewer" if code == TOO_MANY else f"{answer} {self._code()}"
            raise ScopeError(f"{self._url}: the control refuses {word}: {why}")
        if answer == "T_FD":
            raise ScopeError(f"{self._url}: the control has ended the recording")
        return told

    def _code(self) -> str:
        error = self._link.last_error
        return f"{getattr(error.e_code, 'name', 'T_ER')} {int(error.e_code)}"
