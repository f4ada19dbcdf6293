"""Recent wrong tokens: guessing is made slow, for each address and for all together."""

from collections import deque

WINDOW_S = 60.0
OF_ONE_MAX = 5
OF_ALL_MAX = 50
ADDRESSES_MAX = 10_000


class Failures:
    """Wrong tokens of the last minute. Time is an argument."""

    def __init__(self) -> None:
        self._of_all: deque[tuple[float, str]] = deque(maxlen=ADDRESSES_MAX)

    def add(self, peer: str, now_s: float) -> None:
        """One more."""
        self._of_all.append((now_s, peer))

    def wait_s(self, peer: str, now_s: float) -> float:
        """Return how long this address has to wait before it may try again; 0 = not at all."""
        while self._of_all and now_s - self._of_all[0][0] >= WINDOW_S:
            self._of_all.popleft()
        of_one = [at_s for at_s, one in self._of_all if one == peer]
        waits = [of_one[-OF_ONE_MAX] + WINDOW_S - now_s] if len(of_one) >= OF_ONE_MAX else []
        waits += [self._of_all[-OF_ALL_MAX][0] + WINDOW_S - now_s] if len(self._of_all) >= OF_ALL_MAX else []
        return max(waits, default=0.0)
