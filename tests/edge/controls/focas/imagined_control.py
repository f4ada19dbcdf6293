"""A backend without any way to any control: it answers what a test tells it to, and keeps the machine's time."""

from collections.abc import Callable, Mapping, Sequence
from itertools import islice

from pydantic import TypeAdapter

from edge.chosen import PlcAddresses, Variables
from edge.config import EdgeConfig
from edge.controls.focas.calls import CLOCK_WORDS, STATUS_WORDS, Answer, Call, FocasValue, Identity, Opened, Request, keys_of
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.connection import FocasConnection
from edge.sweep import Plain, Sweep

WHO = Identity("31", "M", "G421", "40.1", ("X", "B"))
T0_S = 1_700_000_000.0


def shown(request: Request, otherwise: Mapping[str, Plain]) -> tuple[FocasValue, ...]:
    """Return what a control shows that cuts, but for what is shown otherwise."""
    values: dict[str, str | int | float | None] = dict(
        zip((f"status.{word}" for word in STATUS_WORDS), (1, 3, 1, 0, 0, 0, 0), strict=True)
    )
    values |= {
        "block": "G1 X1.\nM30",
        "program.name": "O1701",
        "alarms": "",
        "modal.G0": "G1",
        "modal.G1": "G17",
        "modal.G2": "G90",
    }
    values |= {"pmc.G12": 155, "pmc.F10:4": 3, "modal.M": 3, "modal.T": 7, "modal.H": 7, "modal.D": 27, "program.number": 1701}
    values |= dict(zip((f"clock.{word}" for word in CLOCK_WORDS), (2023, 11, 14, 22, 13, 21), strict=True))
    values |= otherwise
    return tuple(FocasValue(key, values.get(key, 0)) for key in keys_of(request, WHO.axes))


class ImaginedControl:
    """`fails`: what a call answers in place of values, by its name; `refuses`: what the next openings answer; `shows`: facts."""

    def __init__(self, *, variables: object = None, plc: object = None, **options: object) -> None:
        self.config = EdgeConfig(
            source=FocasConfig.model_validate(options),
            variables=TypeAdapter(Variables).validate_python(variables or {}),
            plc=TypeAdapter(PlcAddresses).validate_python(plc or {}),
        )
        self.shows: dict[str, Plain] = {}
        self.fails: dict[str, int] = {}
        self.refuses: list[int] = []
        self.asked: list[list[str]] = []
        self.now_s, self.call_s, self.waits = 0.0, 0.0, list[float]()
        self.opened, self.closed = 0, 0
        self.before_ask: Callable[[], None] = lambda: None
        self.connection = FocasConnection(
            self.config, backend=self, clock=lambda: self.now_s, wall_s=lambda: T0_S + self.now_s, wait=self.wait
        )

    def wait(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.now_s += seconds

    def open(self) -> Opened:
        self.opened += 1
        return Opened(self.refuses.pop(0), why="told to") if self.refuses else Opened(0, WHO)

    def ask(self, requests: Sequence[Request]) -> tuple[Answer, ...]:
        self.before_ask()
        self.asked.append([request.name for request in requests])
        self.now_s += self.call_s
        return tuple(Answer(self.fails[r.name]) if r.name in self.fails else Answer(0, shown(r, self.shows)) for r in requests)

    def close(self) -> None:
        self.closed += 1

    def looks(self, number: int) -> list[Sweep]:
        """The next sweeps."""
        return [Sweep.decode(raw) for raw in islice(self.connection.frames(), number)]


def times_asked(control: ImaginedControl, call: Call) -> int:
    return sum(name.split()[0] == call for asked in control.asked for name in asked)
