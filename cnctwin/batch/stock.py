"""The box that a program cuts from, as an option of a command states it."""

from pydantic import ValidationError

from cnctwin.errors import UsageError
from twin.machine import MachineFile, Stock
from twin.vocabulary.faults import faults_of

FORM = "write the edges of the block as X0:X1,Y0:Y1,Z0:Z1 in mm, such as 0:80,0:60,-20:0"


def with_stock(machine: MachineFile, text: str | None) -> MachineFile:
    """Return the machine with this box as its [stock], or as it is where there is no text.

    text: from and to along X, Y and Z in machine coordinates, mm, as in "0:80,0:60,-20:0"

    Raises UsageError where the text is not a box.
    """
    if text is None:
        return machine
    edges = [edge.split(":") for edge in text.split(",")]
    try:
        if len(edges) != 3:
            raise ValueError
        lows, highs = zip(*((float(low), float(high)) for low, high in edges), strict=True)
        stock = Stock.model_validate({"min_mm": lows, "max_mm": highs})
    except ValidationError as error:
        raise UsageError(f"--stock {text}: {'; '.join(faults_of(error.errors(), Stock))}; {FORM}") from None
    except ValueError:
        raise UsageError(f"--stock {text}: is not a box; {FORM}") from None
    return machine.model_copy(update={"stock": stock})
