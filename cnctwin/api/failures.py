"""Recent wrong tokens: who guesses is made to wait, and nobody else. The right token is never asked to."""

from collections import OrderedDict, deque

WINDOW_S = 60.0
OF_ONE_MAX = 5
ADDRESSES_MAX = 10_000
DELAY_S = 0.2


class Failures:
    """Wrong tokens of the last minute, by address. Time is an argument."""

    def __init__(self) -> None:
        self._by_address: OrderedDict[str, deque[float]] = OrderedDict()

    def add(self, address: str, now_s: float) -> float:
        """Count a wrong token; return how long the address has to wait before the next one is looked at, 0 = not at all.

        One that comes before that is not counted, so the wait ends however often somebody tries.
        """
        times = self._by_address.setdefault(address, deque(maxlen=OF_ONE_MAX))
        if len(times) == OF_ONE_MAX and (wait_s := times[0] + WINDOW_S - now_s) > 0.0:
            return wait_s
        times.append(now_s)
        self._by_address.move_to_end(address)
        if len(self._by_address) > ADDRESSES_MAX:
            self._by_address.popitem(last=False)
        return 0.0
