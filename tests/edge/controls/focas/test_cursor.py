"""From sweeps to samples: what each fact is, where the tool number comes from, and when a tool is changed."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.chosen import PlcSection, VariableSection
from edge.config import EdgeConfig, SignalSection
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.cursor import Cursor, parse, start
from edge.running.pipeline import Pipeline
from edge.sample import Drop, EdgeSample, SampleSet
from edge.sweep import Fact, Hole, Plain, Sweep
from sparkplug.quality import Quality
from twin.vocabulary.signals import Kind

T0_MS = 1_700_000_000_000
REFUSED = "EW_NOOPT (6): the control does not have the option for this function"
IDENTITY = {
    "control.cnc_type": "31",
    "control.mt_type": "M",
    "control.series": "G421",
    "control.version": "1",
    "control.axes": "X",
}
CUT: dict[str, Plain] = {
    "status.aut": 1, "status.run": 3, "status.motion": 1, "status.mstb": 0, "status.emergency": 0,
    "status.alarm": 0, "status.edit": 0,
    "program.number": 1701, "sequence": 10, "modal.M": 3, "modal.T": 2, "pmc.F7": 0, "pmc.F10:4": 3, "block": "G1 X1.",
}  # fmt: skip


class Machine:
    """Sweeps of one control, 200 ms apart unless told otherwise, and what became of them."""

    def __init__(
        self,
        signals: dict[str, SignalSection] | None = None,
        variables: dict[str, VariableSection] | None = None,
        plc: dict[str, PlcSection] | None = None,
        **options: object,
    ) -> None:
        source = FocasConfig.model_validate(options)
        self.config = EdgeConfig(source=source, signals=signals or {}, variables=variables or {}, plc=plc or {})
        self.cursor, self.number, self.t_ms = start(self.config), 0, T0_MS
        self.pipeline, self.published = Pipeline(self.config), list[EdgeSample]()
        self.frame = SampleSet()

    def shows(self, facts: dict[str, Plain], *, after_ms: int = 200, holes: tuple[Hole, ...] = ()) -> "Machine":
        rows = {**(IDENTITY if not self.number else {}), **CUT, **facts}
        self.t_ms += after_ms if self.number else 0
        told = tuple(Fact(key, None, v[1:]) if isinstance(v, str) and v[:1] == "!" else Fact(key, v) for key, v in rows.items())
        raw = Sweep("life", self.number, self.t_ms, told, holes, 200, available=True).encode()
        self.cursor, self.frame = parse(self.config, self.cursor, raw)
        assert self.frame.accounted()
        self.number += 1
        self.published += [one for row in self.pipeline.take(self.frame, self.t_ms / 1000).rows for one in row]
        return self

    def last(self, name: str) -> EdgeSample:
        return next(sample for sample in reversed(self.frame.samples) if sample.signal == name)

    def told(self, name: str) -> list[tuple[int, object]]:
        """When, in ms, and what was published of a signal."""
        return [(one.timestamp_ms - T0_MS, one.value) for one in self.published if one.signal == name]


M6 = {"pmc.F7": 1, "pmc.F10:4": 6, "modal.M": 6, "status.mstb": 1, "block": "T7 M6", "modal.T": 7}


@pytest.mark.parametrize(
    ("facts", "name", "value", "why"),
    [
        ({"status.aut": 0}, "controller_mode", "MANUAL_DATA_INPUT", None),
        ({"status.aut": 2}, "controller_mode", None, "no meaning: 2"),
        ({"status.run": 2}, "exec_state", "FEED_HOLD", None),
        ({"status.run": 1, "modal.M": 0}, "exec_state", "PROGRAM_STOPPED", None),
        ({"status.run": 3, "status.emergency": 1}, "exec_state", "STOPPED", None),
        ({"status.run": 9}, "exec_state", None, "no meaning: 9"),
        ({"pmc.G12": 0x9B}, "feed_override_pct", 100.0, None),
        ({"pmc.G14": 3}, "rapid_override_pct", None, "F0: its speed is a parameter"),
        ({"pmc.G30": 120}, "spindle_override_pct", 120.0, None),
        ({"position.B": 90.5}, "axis_b_pos_deg", 90.5, None),
        ({"position.Z2": -1.25}, "axis_z2_pos_mm", -1.25, None),
        ({"servo_load.X": -40}, "axis_x_load_pct", -40.0, None),
        ({"spindle_load": 950}, "spindle_load_pct", None, "outside 0 to 200 %: 950"),
        ({"spindle_load": f"!{REFUSED}"}, "spindle_load_pct", None, REFUSED),
        ({"program.name": "//CNC_MEM/USER/PATH1/O2001"}, "program", "O2001", None),
        ({"program.name": f"!{REFUSED}"}, "program", "O1701", None),
        ({"block": "N5 G1 X1. ;\nT9 M6"}, "nc_block", "N5 G1 X1.", None),
        ({"alarms": "SV0401 SERVO ALARM"}, "alarm", "SV0401 SERVO ALARM", None),
        ({"alarm_list": "[]"}, "alarms", "[]", None),
        ({"alarm_history": "[]"}, "alarm_history", "[]", None),
        ({"operator_message": "CHECK COOLANT"}, "operator_message", "CHECK COOLANT", None),
        ({"program.comment": "BASE PLATE"}, "program_comment", "BASE PLATE", None),
        ({"offset.length": 127.5}, "tool_length_mm", 127.5, None),
        ({"offset.length": "!no offset is in force: H 0"}, "tool_length_mm", None, "no offset is in force: H 0"),
        ({"offset.length_wear": -0.01}, "tool_length_wear_mm", -0.01, None),
        ({"offset.radius": 6.0}, "tool_radius_mm", 6.0, None),
        ({"offset.radius_wear": 0.005}, "tool_radius_wear_mm", 0.005, None),
    ],
)
def test_what_each_fact_is(facts: dict[str, Plain], name: str, value: object, why: str | None) -> None:
    sample = Machine().shows(facts).last(name)
    assert (sample.value, sample.reason) == (value, why)
    assert sample.quality is (Quality.BAD if value is None else Quality.GOOD)


@pytest.mark.parametrize(("unit", "suffix"), [("minutes", "min"), ("uses", "count")])
def test_tool_life_is_counted_in_the_unit_of_the_configuration(unit: str, suffix: str) -> None:
    machine = Machine(backend="library", library="x", tool_life_unit=unit).shows({"life.used": 37, "life.limit": 60})
    assert (machine.last(f"tool_life_used_{suffix}").value, machine.last(f"tool_life_limit_{suffix}").value) == (37, 60)
    machine.shows({"life.used": None, "life.limit": None})
    assert machine.last(f"tool_life_used_{suffix}").reason == "unavailable: no tool group is in use"


def test_a_byte_of_which_several_bits_are_read_is_one_observation() -> None:
    machine = Machine(
        tool_change_pmc="R100.0",
        variables={"width": VariableSection(address="#500", unit="mm", scale=0.5)},
        plc={
            "door": PlcSection(address="R100.3", kind="flag"),
            "pump": PlcSection(address="R100.4", kind="flag"),
            "pressure": PlcSection(address="D300:2", unit="bar", scale=0.1),
        },
    ).shows({"macro.500": 80, "pmc.R100": 0b0001_1001, "pmc.D300:2": 62})
    assert [machine.last(name).value for name in ("variable_width", "plc_door", "plc_pump")] == [40.0, True, True]
    assert machine.last("plc_pressure").value == pytest.approx(6.2)
    offers = {offer.signal: offer for offer in machine.frame.offers or ()}
    assert (offers["plc_pressure"].declared.unit, offers["variable_width"].source) == ("bar", "cnc_rdmacro #500")
    assert offers["plc_door"].declared.kind is Kind.FLAG
    assert machine.frame.accounted()
    machine.shows({"macro.500": None, "pmc.R100": "!no"})
    assert machine.last("variable_width").reason == "unavailable: the variable is vacant"
    assert machine.last("plc_door").reason == "no"


def test_the_offers_are_the_signals_of_this_control_with_their_functions() -> None:
    machine = Machine(signals={"nc_line": SignalSection(publish=False)}).shows({"position.X": 1.0, "spindle_load": 3})
    offers = {offer.signal: offer.source for offer in machine.frame.offers or ()}
    assert offers["axis_x_pos_mm"] == "cnc_rddynamic2 machine X"
    assert offers["tool_number"] == "cnc_modal T"
    assert "nc_line" not in offers
    assert not {sample.signal for sample in machine.frame.samples} & {"nc_line"}
    assert machine.shows({}).frame.offers is None


def test_native_units_and_scales_of_the_configuration_count() -> None:
    machine = Machine(signals={"feed_mm_min": SignalSection(native_unit="INCH/MINUTE")}).shows({"feed": 10})
    assert machine.last("feed_mm_min").value == 254.0


def test_a_change_lasts_as_long_as_the_control_works_on_m6() -> None:
    machine = Machine().shows({}).shows({}).shows(M6)
    for _ in range(14):
        machine.shows(M6)
    machine.shows({"modal.T": 7}).shows({"modal.T": 8})
    assert machine.told("tool_change_active") == [(0, False), (400, True), (3400, False)]
    assert [value for _, value in machine.told("tool_number")] == [None, 7]
    assert machine.told("tool_change_evidence")[-1][1] == "block commands a tool change + M6 in progress + cue ended"


def test_a_tool_that_is_called_ahead_is_not_in_the_spindle_yet() -> None:
    machine = Machine().shows({"modal.T": 5})
    assert (machine.last("tool_number").value, "call ahead" in str(machine.last("tool_number").reason)) == (None, True)
    machine.shows(M6).shows({"modal.T": 7}).shows({"modal.T": 9})
    assert machine.last("tool_number").value == 7
    machine.shows({"modal.T": 9}, after_ms=2000, holes=(Hole("gone", 1, 2, 3),))
    assert machine.last("tool_number").value is None  # a change may have come and gone


@pytest.mark.parametrize("missing", ["!EW_DATA (5): wrong data", None])
def test_a_change_whose_t_code_is_not_told_leaves_the_number_unknown(missing: str | None) -> None:
    machine = Machine().shows({}).shows(M6).shows({"modal.T": 7})
    assert machine.last("tool_number").value == 7
    silent = {**M6, "modal.T": missing}
    machine.shows(silent).shows({"modal.T": missing}).shows({"modal.T": 9})
    assert machine.last("tool_number").value is None


@pytest.mark.parametrize(
    ("options", "mt_type", "facts", "number"),
    [
        ({"backend": "library", "library": "x"}, "M", {"tool": 12}, 12),
        ({"backend": "library", "library": "x"}, "M", {"tool": f"!{REFUSED}"}, None),
        ({}, "T", {"modal.T": 3}, 3),
        ({"tool_number": "modal"}, "M", {"modal.T": 3}, 3),
        ({"tool_number_pmc": "D100:2"}, "M", {"pmc.D100:2": 4}, 4),
        ({"tool_number_pmc": "D100:2"}, "M", {"pmc.D100:2": f"!{REFUSED}"}, None),
    ],
)
def test_where_the_tool_number_comes_from(
    options: dict[str, object], mt_type: str, facts: dict[str, Plain], number: int | None
) -> None:
    assert Machine(**options).shows({"control.mt_type": mt_type, **facts}).last("tool_number").value == number


@pytest.mark.parametrize(
    ("options", "facts", "cue"),
    [
        ({}, {"pmc.F7": 1, "pmc.F10:4": 6}, True),
        ({}, {"pmc.F7": 1, "pmc.F10:4": 8}, False),
        ({}, {"pmc.F7": 0, "pmc.F10:4": 6, "modal.M": 6, "status.mstb": 1}, False),
        ({"tool_change_m_codes": [6, 106]}, {"pmc.F7": 1, "pmc.F10:4": 106}, True),
        ({}, {"pmc.F7": "!no", "modal.M": 6, "status.mstb": 1, "block": "T7 M6"}, True),
        ({}, {"pmc.F7": "!no", "modal.M": 6, "status.mstb": 1, "block": "G43 H1 T8"}, False),  # a T code, while M6 still stands
        ({}, {"pmc.F7": "!no", "modal.M": 6, "status.mstb": 0}, False),
        ({}, {"pmc.F7": "!no", "modal.M": "!no"}, None),
        ({"tool_change_pmc": "R100.3"}, {"pmc.R100": 8, "pmc.F7": 0}, True),
        ({"tool_change_pmc": "R100.3"}, {"pmc.R100": 4, "pmc.F7": 1, "pmc.F10:4": 6}, False),
        ({"tool_change_pmc": "R100.3"}, {"pmc.R100": "!no"}, None),
    ],
)
def test_what_says_that_a_tool_is_being_changed(options: dict[str, object], facts: dict[str, Plain], cue: bool | None) -> None:
    machine = Machine(**options).shows(facts)
    assert machine.last("tool_change_cue").value is cue
    assert machine.last("tool_change_cue").reason
    assert "tool_change_cue" not in {sample.signal for sample in machine.published}


def test_the_strobe_alone_tells_a_change_where_the_status_is_refused() -> None:
    config, cursor = EdgeConfig(source=FocasConfig()), Cursor()
    facts = (Fact("pmc.F7", 1), Fact("pmc.F10:4", 6), Fact("modal.T", 7))
    _, frame = parse(config, cursor, Sweep("life", 0, T0_MS, facts, interval_ms=200).encode())
    assert [(one.signal, one.value) for one in frame.samples] == [("tool_change_cue", True), ("tool_number", None)]


def test_facts_without_a_signal_are_counted() -> None:
    machine = Machine().shows({}).shows({"tool": 12, "modal.S": 8500, "modal.G2": "G90"})
    assert machine.frame.dropped[Drop.UNMAPPED] == 3 + 3  # with motion, alarm and edit of the status


_words = (
    st.none()
    | st.booleans()
    | st.integers(-(2**40), 2**40)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=20)
)
_keys = st.sampled_from(
    [*IDENTITY, *CUT, "tool", "alarms", "pmc.G14", "position.X", "servo_load.B", "offset.length", "position.é", "x"]
)


@settings(max_examples=60)
@given(st.lists(st.dictionaries(_keys, st.tuples(_words, st.sampled_from(["", REFUSED])), max_size=12), min_size=1, max_size=4))
def test_whatever_a_sweep_holds_each_fact_is_accounted_for(looks: list[dict[str, tuple[Plain, str]]]) -> None:
    config, cursor = EdgeConfig(source=FocasConfig()), Cursor()
    for number, look in enumerate(looks):
        facts = tuple(Fact(key, None if fault else value, fault) for key, (value, fault) in look.items())
        cursor, frame = parse(config, cursor, Sweep("life", number, T0_MS + 200 * number, facts, interval_ms=200).encode())
        assert frame.accounted()
        assert all(sample.value is not None or sample.reason for sample in frame.samples)
