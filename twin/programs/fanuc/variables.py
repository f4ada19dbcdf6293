"""Macro variables: #1-#33 of each call level, #100-#199 and #500-#999 of all, and a door to the system variables."""

import math
from collections.abc import Callable, Mapping

from twin.programs.refusal import RefusedError

LOCAL_MAX = 33


class Variables:
    """The variables that `#` reads and writes. None is the null variable.

    read_system, write_system: what to do from #1000 on; given the number
    """

    __slots__ = ("common", "local", "read_system", "write_system")

    def __init__(
        self,
        initial: Mapping[int, float],
        read_system: Callable[[int], float | None],
        write_system: Callable[[int, float | None], None],
    ) -> None:
        self.common: dict[int, float] = {number: float(value) for number, value in initial.items() if number > LOCAL_MAX}
        self.local: dict[int, float] = {number: float(value) for number, value in initial.items() if 1 <= number <= LOCAL_MAX}
        self.read_system, self.write_system = read_system, write_system

    def read(self, number: float) -> float | None:
        """Value of #number; RefusedError where the control has none."""
        index = int(number)
        if index != number:
            raise RefusedError(f"#{number:g}", "the number of a variable has to be whole")
        if 1 <= index <= LOCAL_MAX:
            return self.local.get(index)
        if 100 <= index <= 199 or 500 <= index <= 999:
            return self.common.get(index)
        if index == 0:
            return None
        if index >= 1000:
            return self.read_system(index)
        raise RefusedError(f"#{index}", "there is no such variable; use #1-#33, #100-#199, #500-#999")

    def write(self, number: float, value: float | None) -> None:
        """Set #number; None makes it null."""
        index = int(number)
        if index != number:
            raise RefusedError(f"#{number:g}", "the number of a variable has to be whole")
        if value is not None and not math.isfinite(value):
            raise RefusedError(f"#{index}", "the result is too large")
        if 1 <= index <= LOCAL_MAX:
            table = self.local
        elif 100 <= index <= 199 or 500 <= index <= 999:
            table = self.common
        elif index >= 1000:
            self.write_system(index, value)
            return
        else:
            raise RefusedError(f"#{index}", "cannot be set; use #1-#33, #100-#199, #500-#999")
        if value is None:
            table.pop(index, None)
        else:
            table[index] = value
