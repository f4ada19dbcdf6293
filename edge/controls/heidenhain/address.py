"""The addresses of [variables] and [plc] on a HEIDENHAIN control: a place in the PLC memory, or a data path of an iTNC 530.

A data path is what the control's own data access calls a value, such as `\\TABLE\\TOOL\\T\\1\\L`; a slash will do as well.
"""

import re

from edge.chosen import Chosen
from edge.controls.heidenhain.plc import PlcAddress
from edge.errors import ConfigError

_PATH = re.compile(r"[\\/][\x20-\x7e]{1,200}")


def address_of(chosen: Chosen) -> PlcAddress | str:
    """Read an address.

    >>> address_of(Chosen("plc_door", "M4002", is_plc=True)), address_of(Chosen("variable_l", "/TABLE/TOOL/T/1/L"))
    (PlcAddress(kind='M', number=4002), '/TABLE/TOOL/T/1/L')
    """
    text = chosen.address
    if _PATH.fullmatch(text):
        return text
    if chosen.is_plc:
        address = PlcAddress.parse(text)
        if address.kind == "S":
            raise ConfigError(f"{text!r} is a string; a number or a flag is needed")
        return address
    if re.fullmatch(r"Q[LR]?\d+", text):
        raise ConfigError(
            f"{text!r} is a Q parameter, which LSV2 does not tell; hand it to the PLC (FN 19) and name that in [plc]"
        )
    raise ConfigError(f"{text!r} is no data path, such as /TABLE/TOOL/T/1/L (iTNC 530 only)")
