"""The addresses of [variables] and [plc] on a FANUC control: a macro variable, and a place in the PMC.

`#500` is a macro variable, common or system; `R100.3`, `D300`, `D300:2` and `D300:2s` are PMC addresses
(`edge.controls.focas.pmc`).
"""

import re
from typing import NamedTuple

from edge.chosen import Chosen
from edge.controls.focas.calls import Call, Request, keys_of
from edge.controls.focas.pmc import pmc_address
from edge.errors import ConfigError

_VARIABLE = re.compile(r"#([1-9]\d{0,4})")


class Address(NamedTuple):
    """The address that is read, and the bit of the answer that counts (None: all of it)."""

    request: Request
    bit: int | None = None

    @property
    def fact(self) -> str:
        """Return the key of the fact that holds the answer."""
        return keys_of(self.request, ())[0]


def address_of(chosen: Chosen) -> Address:
    """Read an address.

    >>> address_of(Chosen("plc_door_open", "R100.3", is_plc=True))
    Address(request=Request(call=<Call.PMC: 'pmc_rdpmcrng'>, argument='R100'), bit=3)
    """
    if chosen.is_plc:
        place = pmc_address(chosen.address)
        if place.bit is None:
            return Address(Request(Call.PMC, chosen.address.upper()))
        return Address(Request(Call.PMC, place.byte_name), place.bit)
    found = _VARIABLE.fullmatch(chosen.address)
    if found is None:
        raise ConfigError(f"{chosen.address!r} is no macro variable; write #500")
    return Address(Request(Call.MACRO, found[1]))
