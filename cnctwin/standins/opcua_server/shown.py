"""The server's view of a control, model by model: where it hangs in the address space, its type, and its value.

The types of the companion models are built here with their namespaces and browse names, only those that are needed, no nodeset.
SINUMERIK names are those of `edge/controls/opcua/maps/sinumerik.toml`, so what is said there of their certainty holds here too.
"""

from collections.abc import Callable
from dataclasses import dataclass

from cnctwin.standins.simulated_control.state import AXES, ControlState

SINUMERIK, SINUMERIK_OBJECT = "SinumerikVarProvider", "Sinumerik"
CNC = "http://opcfoundation.org/UA/CNC"
MACHINE_TOOL = "http://opcfoundation.org/UA/MachineTool/"
MODELS = {"sinumerik": SINUMERIK, "cnc_40502": CNC, "machinetool_40501": MACHINE_TOOL}
TOOLS = (1, 2, 3, 4, 5)
ADDRESSES = ("R10", "DB100.DBW2", "M5.0")  # what a configuration may choose besides what a map reads
Value = str | int | float | bool | list[str]


@dataclass(frozen=True, slots=True, eq=False)  # looked up by itself, fifty times a second
class Shown:
    """One variable. `kind` is the name of a VariantType.

    path: below Objects; each object has its type behind a colon, and behind that the type that it is derived from
    identifier: of its node, where it is a text; unit: what its EngineeringUnits say
    """

    model: str
    path: tuple[str, ...]
    kind: str
    value: Callable[[ControlState], Value]
    identifier: str = ""
    unit: str = ""


_PROGRAM_STATUS = {"ACTIVE": 3, "INTERRUPTED": 1, "STOPPED": 2, "FEED_HOLD": 2, "WAIT": 4}
_CNC_STATUS = {"ACTIVE": 1, "INTERRUPTED": 3, "STOPPED": 0, "FEED_HOLD": 0, "WAIT": 2}
_CHANNEL_STATE = {"ACTIVE": 0, "INTERRUPTED": 1, "STOPPED": 1, "FEED_HOLD": 1, "WAIT": 0}
_MODE = {"MANUAL": 0, "MANUAL_DATA_INPUT": 1, "AUTOMATIC": 2}
_CHANNEL_MODE = {"AUTOMATIC": 0, "MANUAL_DATA_INPUT": 1, "MANUAL": 2}


def shown() -> tuple[Shown, ...]:
    """Everything of all models."""
    return (*_sinumerik(), *_cnc(), *_machine_tool())


def _sinumerik() -> tuple[Shown, ...]:
    def one(identifier: str, kind: str, value: Callable[[ControlState], Value]) -> Shown:
        return Shown(SINUMERIK, ("Sinumerik:", *identifier.strip("/").split("/")), kind, value, identifier)

    return (
        one("/Channel/State/actTNumber[u1,1]", "UInt16", lambda s: s.tool_number),
        one("/Channel/State/progStatus[u1,1]", "UInt16", lambda s: _PROGRAM_STATUS.get(s.exec_state, 5)),
        one("/Bag/State/opMode[u1,1]", "UInt16", lambda s: _MODE.get(s.mode, 2)),
        one("/Channel/ProgramInfo/progName[u1,1]", "String", lambda s: s.program),
        one("/Channel/ProgramInfo/actBlock[u1,1]", "String", lambda s: s.block),
        one("/Channel/ProgramInfo/actLineNumber[u1,1]", "Int32", lambda s: s.line),
        one("/Channel/Spindle/actSpeed[u1,1]", "Double", lambda s: s.spindle_rpm),
        one("/Channel/Spindle/driveLoad[u1,1]", "Double", lambda s: s.spindle_load_pct),
        one("/Channel/Spindle/speedOvr[u1,1]", "Double", lambda s: s.spindle_override_pct),
        one("/Channel/State/actFeedRateIpo[u1,1]", "Double", lambda s: s.feed_mm_min),
        one("/Channel/State/feedRateIpoOvr[u1,1]", "Double", lambda s: s.feed_override_pct),
        one("/Channel/State/rapFeedRateOvr[u1,1]", "Double", lambda s: s.rapid_override_pct),
        one("/Channel/MachineAxis/actToolBasePos[u1,1]", "Double", lambda s: s.axis_pos_mm[0]),
        one("/Channel/MachineAxis/actToolBasePos[u1,2]", "Double", lambda s: s.axis_pos_mm[1]),
        one("/Channel/MachineAxis/actToolBasePos[u1,3]", "Double", lambda s: s.axis_pos_mm[2]),
        one("/Nck/TopPrioAlarm/alarmNo", "Int32", lambda s: 0 if s.alarm is None else s.alarm[0]),
        one("/Channel/ProgramInfo/msg", "String", lambda s: f"PART {s.part_count + 1}" if s.exec_state == "ACTIVE" else ""),
        one("/Channel/Parameter/R[u1,10]", "Double", lambda s: float(s.part_count)),
        one("/Plc/DB100.DBW2", "UInt32", lambda s: 45 if s.coolant_on else 3),  # coolant pressure in tenths of a bar
        one("/Plc/M5.0", "Boolean", lambda s: s.coolant_on),
        *(line for tool in TOOLS for line in _tool_tables(tool)),
    )


def _tool_tables(tool: int) -> tuple[Shown, ...]:
    """The column of one tool: geometry and wear, and what is left of its life where that is monitored."""

    def one(table: str, line: int, value: Callable[[ControlState], Value]) -> Shown:
        identifier = f"/Tool/{table}[u1,c{tool},{line}]"
        return Shown(SINUMERIK, ("Sinumerik:", *identifier.strip("/").split("/")), "Double", value, identifier)

    life_min, life_count = (60.0, 200.0) if tool != 5 else (0.0, 0.0)
    return (
        one("Compensation/edgeData", 3, lambda s: 100.0 + 10 * tool),
        one("Compensation/edgeData", 6, lambda s: 2.0 * tool),
        one("Compensation/edgeData", 12, lambda s: -0.01 * tool),
        one("Compensation/edgeData", 15, lambda s: -0.002 * tool),
        one("Supervision/data", 2, lambda s: life_min - round(s.at_s / 600, 1) % 60 if life_min else 0.0),
        one("Supervision/data", 4, lambda s: life_count - s.part_count % 200 if life_count else 0.0),
        one("Supervision/data", 5, lambda s: life_min),
        one("Supervision/data", 6, lambda s: life_count),
    )


def _cnc() -> tuple[Shown, ...]:
    root = "CncInterface:CncInterfaceType"
    channel = (root, "CncChannelList:CncChannelListType", "Channel1:SimulatedChannelType:CncChannelType")
    spindle = (root, "CncSpindleList:CncSpindleListType", "S1:CncSpindleType")

    def one(where: tuple[str, ...], name: str, kind: str, value: Callable[[ControlState], Value], unit: str = "") -> Shown:
        return Shown(CNC, (*where, *name.split("/")), kind, value, unit=unit)

    axes = tuple(
        each
        for number, letter in enumerate(AXES)
        for axis in [(root, "CncAxisList:CncAxisListType", f"{letter.upper()}:CncAxisType")]
        for each in (
            one(axis, "IsRotational", "Boolean", lambda s: False),
            one(axis, "PosDirect/ActPos", "Double", lambda s, n=number: s.axis_pos_mm[n], "mm"),  # type: ignore[misc]
            one(axis, "ActLoad", "Double", lambda s, n=number: s.axis_load_pct[n], "%"),  # type: ignore[misc]
        )
    )
    return (
        one(channel, "ToolId", "UInt32", lambda s: s.tool_number),
        one(channel, "ActProgramStatus", "Int32", lambda s: _CNC_STATUS.get(s.exec_state, 4)),
        one(channel, "ActOperationMode", "Int32", lambda s: _MODE.get(s.mode, 2)),
        one(channel, "ActProgramName", "String", lambda s: s.program),
        one(channel, "ActProgramBlock", "String", lambda s: ["", s.block, ""]),
        one(channel, "ActProgramLine", "String", lambda s: f"N{s.line}"),
        one(channel, "ActFeedrate", "Double", lambda s: s.feed_mm_min / 1000, "m/min"),  # a unit of its own, to be converted
        one(channel, "ActOverride", "Double", lambda s: s.feed_override_pct, "%"),
        one(spindle, "ActSpeed", "Double", lambda s: s.spindle_rpm, "1/min"),
        one(spindle, "ActLoad", "Double", lambda s: s.spindle_load_pct, "%"),
        one(spindle, "ActOverride", "Double", lambda s: s.spindle_override_pct, "%"),
        *axes,
    )


def _tool_life(tool_path: tuple[str, ...], tool: int) -> tuple[Shown, ...]:
    """The life of one tool: of odd ones in hours that are left, of even ones in parts that were made."""

    def one(name: str, kind: str, value: Callable[[ControlState], Value], unit: str = "") -> Shown:
        return Shown(MACHINE_TOOL, (*tool_path, "ToolLife", *name.split("/")), kind, value, unit=unit)

    if tool % 2:
        return (
            one("Time", "Double", lambda s: 1.0 - s.part_count / 100 % 1.0, "h"),
            one("Time/Indication", "Int32", lambda s: 0),
            one("Time/IsCountingUp", "Boolean", lambda s: False),
            one("Time/StartValue", "Double", lambda s: 1.0),
            one("Time/LimitValue", "Double", lambda s: 0.0),
        )
    return (
        one("Parts", "UInt32", lambda s: s.part_count % 200),
        one("Parts/Indication", "Int32", lambda s: 1),
        one("Parts/IsCountingUp", "Boolean", lambda s: True),
        one("Parts/LimitValue", "UInt32", lambda s: 200),
    )


def _machine_tool() -> tuple[Shown, ...]:
    root = ("Machines:", "Mill:MachineToolType")
    channel = (*root, "Monitoring:MonitoringType", "Channel1:ChannelMonitoringType")
    spindle = (*root, "Monitoring:MonitoringType", "Spindle1:SpindleMonitoringType")
    program = (*root, "Production:ProductionType", "ActiveProgram:ProductionActiveProgramType")

    def one(where: tuple[str, ...], name: str, kind: str, value: Callable[[ControlState], Value]) -> Shown:
        return Shown(MACHINE_TOOL, (*where, *name.split("/")), kind, value)

    tools = tuple(
        each
        for tool in TOOLS
        for where in [(*root, "Equipment:EquipmentType", "Tools:ToolListType", f"Tool{tool}:ToolType")]
        for each in (
            one(where, "ControlIdentifier1", "UInt32", lambda s, t=tool: t),  # type: ignore[misc]
            one(where, "Location/Name", "String", lambda s, t=tool: "Spindle" if s.tool_number == t else "Magazine"),  # type: ignore[misc]
            one(where, "Location/PlaceNumber", "UInt16", lambda s, t=tool: 99 if s.tool_number == t else t),  # type: ignore[misc]
            *_tool_life(where, tool),
        )
    )
    return (
        one(channel, "ChannelState", "Int32", lambda s: _CHANNEL_STATE.get(s.exec_state, 2)),
        one(channel, "ChannelMode", "Int32", lambda s: _CHANNEL_MODE.get(s.mode, 0)),
        one(channel, "FeedOverride", "Double", lambda s: s.feed_override_pct),
        one(channel, "RapidOverride", "Double", lambda s: s.rapid_override_pct),
        one(spindle, "Override", "Double", lambda s: s.spindle_override_pct),
        one(program, "Name", "String", lambda s: s.program),
        *tools,
    )
