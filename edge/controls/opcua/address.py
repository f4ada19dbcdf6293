"""The node of an address in [variables] or [plc]: any node by its name, or as a SINUMERIK's manual writes what it has.

Forms as in the manual (6FC5397-1DP41, 5.3): `/Channel/Parameter/R[u1,10]` is R parameter 10 of channel 1, so is `R10`; a PLC
address is an IEC address, with a type behind it where that is not the word of its width.

>>> node_of_address(Chosen("variable_width", "R10"))
'nsu=SinumerikVarProvider;s=/Channel/Parameter/R[u1,10]'
>>> node_of_address(Chosen("plc_pressure", "DB2.DBD0:REAL", is_plc=True))
'nsu=SinumerikVarProvider;s=/Plc/DB2.DBD0:REAL'
>>> node_of_address(Chosen("plc_door", "nsu=urn:vendor;i=4711", is_plc=True))
'nsu=urn:vendor;i=4711'
"""

import re

from edge.chosen import Chosen
from edge.controls.opcua.point import node_of
from edge.errors import ConfigError

SINUMERIK = "SinumerikVarProvider"
_R = re.compile(r"R([1-9]\d{0,4})")
_PLC = re.compile(
    r"(DB\d{1,5}\.DB(X\d{1,5}\.[0-7]|[BWD]\d{1,5})|[IQM](\d{1,5}\.[0-7]|[BWD]\d{1,5})|[CT]\d{1,5})(:(REAL|DINT|INT|DWORD|WORD|BYTE))?"
)
_PATH = re.compile(r"/\S+")


def node_of_address(chosen: Chosen) -> str:
    """Return the name of the node; ConfigError where the address is of no known form."""
    text = chosen.address
    r_parameter = None if chosen.is_plc else _R.fullmatch(text)
    if r_parameter:
        return f"nsu={SINUMERIK};s=/Channel/Parameter/R[u1,{r_parameter[1]}]"
    if chosen.is_plc and _PLC.fullmatch(text):
        return f"nsu={SINUMERIK};s=/Plc/{text}"
    if _PATH.fullmatch(text):
        return f"nsu={SINUMERIK};s={text}"
    try:
        node_of(text)
    except ConfigError:
        ours = "DB100.DBW2, DB2.DBD0:REAL or M5.0" if chosen.is_plc else "R10"
        raise ConfigError(
            f"{text!r} is no address; write nsu=<namespace URI>;s=<identifier> (or i=, g=, b=), or of a SINUMERIK {ours}, "
            "or a path such as /Channel/Parameter/R[u2,56]"
        ) from None
    return text
