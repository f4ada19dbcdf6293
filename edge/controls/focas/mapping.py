"""The mapping from facts of a FANUC control to canonical signals, worked out once for a configuration."""

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from edge.chosen import Chosen
from edge.config import SignalSection
from edge.controls.focas.address import address_of
from edge.controls.focas.config import Config, FocasConfig, LifeUnit
from edge.controls.focas.plan import UNREAD, Signals, change_bit
from edge.controls.focas.states import CueRule
from edge.reading import Target
from edge.signals import signal
from edge.units import conversion

_AXIS = re.compile(r"(position|servo_load)\.([A-Z]\d{0,2})")
_ROTARY = "ABC"
NO_SOURCE = "none"  # of a signal that is a null with the way out
_DEFAULT = SignalSection()
_PLAIN = {
    "program.name": ("program", "cnc_exeprgname"),
    "program.number": ("program", "cnc_rddynamic2 prgnum"),
    "sequence": ("nc_line", "cnc_rddynamic2 seqnum"),
    "feed": ("feed_mm_min", "cnc_actf"),
    "spindle_rpm": ("spindle_rpm", "cnc_acts"),
    "spindle_load": ("spindle_load_pct", "cnc_rdspmeter"),
    "block": ("nc_block", "cnc_rdexecprog"),
    "alarms": ("alarm", "cnc_rdalmmsg2"),
    "alarm_list": ("alarms", "cnc_rdalmmsg2"),
    "alarm_history": ("alarm_history", "cnc_rdalmhistry"),
    "operator_message": ("operator_message", "cnc_rdopmsg"),
    "program.comment": ("program_comment", "cnc_rdprogdir3"),
    "offset.length": ("tool_length_mm", "cnc_rdtofs of H"),
    "offset.length_wear": ("tool_length_wear_mm", "cnc_rdtofs of H"),
    "offset.radius": ("tool_radius_mm", "cnc_rdtofs of D"),
    "offset.radius_wear": ("tool_radius_wear_mm", "cnc_rdtofs of D"),
    "status.aut": ("controller_mode", "cnc_statinfo aut"),
    "status.run": ("exec_state", "cnc_statinfo run"),
    "tool": ("tool_number", "cnc_toolnum"),
    "modal.T": ("tool_number", "cnc_modal T"),
}


_LIFE = {
    LifeUnit.MINUTES: {"life.used": "tool_life_used_min", "life.limit": "tool_life_limit_min"},
    LifeUnit.USES: {"life.used": "tool_life_used_count", "life.limit": "tool_life_limit_count"},
}


class ChosenFact(NamedTuple):
    """A variable or PMC address of the configuration: the fact that holds it, which bit, and the signal that it feeds."""

    fact: str
    bit: int | None
    target: Target
    chosen: Chosen


class FocasMapping:
    """The signals of one configuration. `register`: the fact with the builder's tool number, "" where there is none."""

    def __init__(self, source: FocasConfig, sections: Iterable[tuple[str, SignalSection]], chosen: Iterable[Chosen] = ()) -> None:
        signals, bit = Signals.of(source.path), change_bit(source)
        self.sections = dict(sections)
        self.register = f"pmc.{source.tool_number_pmc}" if source.tool_number_pmc else ""
        self.overrides = {
            f"pmc.{signals.feed}": ("feed_override_pct", signals.feed),
            f"pmc.{signals.rapid}": ("rapid_override_pct", f"{signals.rapid}.0-1"),
            f"pmc.{signals.spindle}": ("spindle_override_pct", signals.spindle),
        }
        rule = CueRule(source.tool_change_m_codes, f"pmc.{signals.strobe}", f"pmc.{signals.code}")
        if bit is not None:
            rule = rule._replace(bit_fact=f"pmc.{bit.byte_name}", bit=bit.bit or 0, bit_name=source.tool_change_pmc)
        self.rule = rule
        self.evidence = tuple(key for key in rule.keys if key != self.register)
        life = _LIFE.get(source.tool_life_unit, {})
        self._life = {key: (name, "cnc_rdcount" if key == "life.used" else "cnc_rdlife") for key, name in life.items()}
        addresses = [(one, address_of(one)) for one in chosen]
        self.chosen = tuple(ChosenFact(at.fact, at.bit, one.target(at.fact), one) for one, at in addresses)
        self._targets: dict[str, Target | None] = {}

    def target(self, key: str) -> Target | None:
        """The signal that a fact feeds, with its conversion; None for one that feeds none, or that is not to be published."""
        if key not in self._targets:
            if len(self._targets) >= 1000:  # nobody has so many facts
                self._targets.clear()
            self._targets[key] = self._target(key)
        return self._targets[key]

    def source_of(self, key: str) -> str:
        """Return where a fact comes from, for births and `edge check`."""
        if key.startswith(UNREAD):
            return NO_SOURCE
        if axis := _AXIS.fullmatch(key):
            return f"{'cnc_rddynamic2 machine' if axis[1] == 'position' else 'cnc_rdsvmeter'} {axis[2]}"
        if key in self.overrides:
            return f"pmc_rdpmcrng {self.overrides[key][1]}"
        known = _PLAIN | self._life
        return known[key][1] if key in known else key.replace("pmc.", "pmc_rdpmcrng ").replace("macro.", "cnc_rdmacro #")

    def _target(self, key: str) -> Target | None:
        name = self._name(key)
        section = self.sections.get(name, _DEFAULT)
        if not name or not section.publish:
            return None
        known = signal(name)
        way = conversion(section.native_unit, known.unit)
        low = known.low if section.low is None else section.low
        high = known.high if section.high is None else section.high
        return Target(key, name, way.factor * section.scale, way.offset, low, high)

    def _name(self, key: str) -> str:
        if key == self.register:
            return "tool_number"
        if key == self.rule.bit_fact:
            return ""
        if key.startswith(UNREAD):
            return key.removeprefix(UNREAD)
        if axis := _AXIS.fullmatch(key):
            suffix = "load_pct" if axis[1] == "servo_load" else "pos_deg" if axis[2][0] in _ROTARY else "pos_mm"
            return f"axis_{axis[2].lower()}_{suffix}"
        known = _PLAIN | self._life
        return known[key][0] if key in known else self.overrides.get(key, ("",))[0]


def mapping_of(config: Config) -> FocasMapping:
    """The mapping of this configuration; the same one as long as the configuration is."""
    return _mapping(config.source, tuple(config.signals.items()), config.chosen)


_mapping = lru_cache(maxsize=256)(FocasMapping)
