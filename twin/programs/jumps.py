"""The bound on jumps, loops and calls, by which a program that has no end is an error and not a hang."""

from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings


class JumpCount:
    """jumps: backwards, loops and calls that were made so far."""

    __slots__ = ("jumps", "settings")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.jumps = 0

    def count(self) -> None:
        """One more jump, loop or call. RefusedError where there are too many: the program has no end."""
        self.jumps += 1
        if self.jumps > self.settings.jumps_max:
            raise RefusedError("", f"more than {self.settings.jumps_max} jumps: the program has no end; look at its loops")

    def check_depth(self, depth: int, word: str) -> None:
        """RefusedError where so many running programs cannot be added to."""
        if depth > self.settings.call_depth_max:
            raise RefusedError(word, f"calls are nested deeper than {self.settings.call_depth_max}; Settings.call_depth_max")
