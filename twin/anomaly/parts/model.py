"""The model of parts: what training learned of a machine, before anything was told of the week that is judged."""

from typing import Annotated

from pydantic import Field

from twin.anomaly.calibration import Positive, Record

OPERATIONS_MAX = 500
SECTIONS_MAX = 64


class PartsModel(Record):
    """signals: in the order of a row; tick_s: the tick it was trained with."""

    signals: Annotated[tuple[str, ...], Field(min_length=1, max_length=16)]
    tick_s: Positive
