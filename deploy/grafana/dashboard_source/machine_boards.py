"""The dashboards that are drawn from the store: the fleet, and one machine from six sides."""

from dashboard_source import words
from dashboard_source.board import DAY_S, HOUR_S, Board, Draw, Limit, Mark, Panel, Reading, Shown, View
from twin.vocabulary import twin_signals as twin

STATE_S = DAY_S  # a state is what it is until it is told again
GAP_S = 2 * HOUR_S  # told once a minute, where it has changed
GAPS = f"{twin.GAP_PREFIX}(spindle_temp_c|spindle_load_pct|spindle_rpm|axis_[a-z]_load_pct)"
TOOL_CHANGES = (
    Mark(name="Another tool", signal="tool_number", colour=words.PURPLE),
    Mark(name="Tool change in progress", signal="tool_change_active", colour=words.GREY, stretch=True),
)
FLOOR = (Limit(None, words.GREEN), Limit(2.0, words.YELLOW), Limit(4.0, words.RED))


def _state(signal: str, legend: str, *, many: bool = False, fleet: bool = False, quality: bool = False) -> Reading:
    return Reading(signal=signal, legend=legend, many=many, fleet=fleet, hold_s=STATE_S, quality=quality, draw=Draw.STEP)


def _shade(signal: str, legend: str) -> Reading:
    return Reading(signal=signal, legend=legend, draw=Draw.SHADE, hold_s=STATE_S)


FLEET = Board(
    uid="cnctwin-fleet",
    title="Fleet",
    says="All machines: what they do, what is unusual, where the twin no longer fits.",
    chooses_machine=False,
    last="now-6h",
    refresh="10s",
    panels=(
        Panel(
            title="Execution",
            says="exec_state of each machine; drawn on for a day at most.",
            series=(_state("exec_state", "{}", fleet=True),),
            view=View.STATES,
            words=words.EXECUTION,
            width=24,
        ),
        Panel(
            title="Severity",
            says=f"{twin.SEVERITY}: high where a rule alarms, medium where only the score does.",
            series=(_state(twin.SEVERITY, "{}", fleet=True),),
            view=View.STATES,
            words=words.SEVERITY,
        ),
        Panel(
            title="Gap growing",
            says=f"{twin.GAP_GROWING}: the standing gap has left what it was while the machine was healthy.",
            series=(_state(twin.GAP_GROWING, "{}", fleet=True),),
            view=View.STATES,
            words=words.GROWTH,
        ),
        Panel(
            title="Adjusted anomaly score",
            says="Beside the peers, 0 while gated. The score as it was before is on the dashboard Anomaly.",
            series=(Reading(signal=twin.ADJUSTED_SCORE, legend="{}", fleet=True, shown=Shown.PEAK),),
        ),
        Panel(
            title="Spindle load",
            says="Largest between two points of the screen.",
            series=(Reading(signal="spindle_load_pct", legend="{}", fleet=True, shown=Shown.PEAK),),
            unit="percent",
        ),
        Panel(
            title="Gap of the spindle load",
            says="rms of twin minus measured, over the floor: 1 is as good as a healthy machine repeats itself.",
            series=(Reading(signal=f"{twin.GAP_PREFIX}spindle_load_pct", legend="{}", fleet=True, hold_s=GAP_S),),
            limits=FLOOR,
        ),
        Panel(
            title="Time that was gated",
            says="Share of the last week in which no score was judged: a gate that hides much is a fault of its own.",
            series=(Reading(signal=twin.GATED_SHARE_PCT, legend="{}", fleet=True, hold_s=STATE_S),),
            view=View.FIGURE,
            unit="percent",
            limits=(Limit(None, words.GREEN), Limit(20.0, words.YELLOW), Limit(50.0, words.RED)),
        ),
    ),
)

MACHINE = Board(
    uid="cnctwin-machine",
    title="Machine",
    says="One machine as it reports itself, and how good each of its signals is.",
    marks=TOOL_CHANGES,
    last="now-30m",
    panels=(
        Panel(
            title="Execution",
            says="exec_state; drawn on for a day at most.",
            series=(_state("exec_state", "execution"),),
            view=View.STATES,
            words=words.EXECUTION,
            width=24,
            height=4,
        ),
        Panel(
            title="Spindle speed",
            says="Actual and commanded.",
            series=(
                Reading(signal="spindle_rpm", legend="actual"),
                Reading(signal="spindle_rpm_cmd", legend="commanded", draw=Draw.BROKEN, hold_s=STATE_S),
            ),
            unit="rotrpm",
        ),
        Panel(
            title="Spindle load",
            says="Of the rated power; the largest between two points of the screen.",
            series=(Reading(signal="spindle_load_pct", legend="load", shown=Shown.PEAK),),
            unit="percent",
        ),
        Panel(
            title="Feed",
            says="Path feed rate, and the override that the operator has set.",
            series=(
                Reading(signal="feed_mm_min", legend="feed"),
                Reading(
                    signal="feed_override_pct", legend="override", unit="percent", right=True, draw=Draw.STEP, hold_s=STATE_S
                ),
            ),
            unit="suffix: mm/min",
        ),
        Panel(
            title="Axis loads",
            says="The largest between two points of the screen.",
            series=(Reading(signal="axis_[a-z]_load_pct", legend="{}", many=True, shown=Shown.PEAK),),
            unit="percent",
        ),
        Panel(
            title="Tool in the spindle",
            says="tool_number.",
            series=(_state("tool_number", "tool"),),
        ),
        Panel(
            title="Quality of its signals",
            says="Stale: nothing is heard of it. Bad: null, with a reason.",
            series=(
                _state("(exec_state|spindle_.*|feed_mm_min|axis_.*|tool_number|ambient_temp_c)", "{}", many=True, quality=True),
            ),
            view=View.STATES,
            words=words.QUALITY,
        ),
    ),
)

ANOMALY = Board(
    uid="cnctwin-anomaly",
    title="Anomaly",
    says="The score as the model gives it and as it is judged, and what was gated: what is not alerted is still here.",
    marks=TOOL_CHANGES,
    last="now-3h",
    panels=(
        Panel(
            title="What was not judged",
            says="Grey: the score is suppressed, for a tool change, or since the peers show the same. It is drawn below.",
            series=(
                _state(twin.TOOL_CHANGE_GATE, "tool-change gate"),
                _state(twin.COMMON_MODE, "peers explain it"),
            ),
            view=View.STATES,
            words=words.GATE,
            width=24,
            height=5,
        ),
        Panel(
            title="Alarms",
            says="Of the score and of each rule; what is not known has no colour.",
            series=(
                _state(twin.ANOMALY_ALARM, "score"),
                _state(twin.RULE_LOAD_OVER_LIMIT, "load over limit"),
                _state(twin.RULE_THERMAL_RUNAWAY, "thermal runaway"),
                _state(twin.RULE_LOAD_WITHOUT_FEED, "load without feed"),
                _state(twin.RULE_VIBRATION, "vibration"),
            ),
            view=View.STATES,
            words=words.ALARMS,
            width=24,
            height=7,
        ),
        Panel(
            title="Scores",
            says="raw: of the model, in gates too. adjusted: beside the peers, 0 while gated. Grey area: gated.",
            series=(
                Reading(signal=twin.RAW_SCORE, legend="raw", shown=Shown.PEAK),
                Reading(signal=twin.ADJUSTED_SCORE, legend="adjusted", shown=Shown.PEAK),
                Reading(signal=twin.ANOMALY_THRESHOLD, legend="threshold", draw=Draw.BROKEN, hold_s=STATE_S),
                _shade(twin.TOOL_CHANGE_GATE, "gate"),
            ),
            width=24,
            height=10,
        ),
        Panel(
            title="Severity",
            says=f"{twin.SEVERITY} of the machine.",
            series=(_state(twin.SEVERITY, "severity"),),
            view=View.STATES,
            words=words.SEVERITY,
            height=5,
        ),
        Panel(
            title="Time that was gated",
            says="Share of the last week in which no score was judged.",
            series=(Reading(signal=twin.GATED_SHARE_PCT, legend="gated", hold_s=STATE_S),),
            view=View.FIGURE,
            unit="percent",
            height=5,
        ),
    ),
)

TEMPERATURE = Board(
    uid="cnctwin-temperature",
    title="Temperature",
    says="The spindle as measured, as the thermal network estimates it, and what lies between.",
    last="now-6h",
    panels=(
        Panel(
            title="Spindle temperature",
            says="Measured and estimated, left; measured minus estimated, right.",
            series=(
                Reading(signal="spindle_temp_c", legend="measured", hold_s=HOUR_S),
                Reading(signal=twin.SPINDLE_TEMP_C, legend="estimated", hold_s=HOUR_S),
                Reading(signal="ambient_temp_c", legend="ambient", draw=Draw.BROKEN, hold_s=STATE_S),
                Reading(signal=twin.SPINDLE_TEMP_RESIDUAL_K, legend="residual", unit="kelvin", right=True, hold_s=HOUR_S),
            ),
            unit="celsius",
            width=24,
            height=12,
        ),
        Panel(
            title="Rise over ambient",
            says=f"{twin.SPINDLE_TEMP_RISE_K}, of the thermal network.",
            series=(Reading(signal=twin.SPINDLE_TEMP_RISE_K, legend="rise", hold_s=HOUR_S),),
            unit="kelvin",
        ),
        Panel(
            title="What warms it",
            says="Speed, left, and load, right.",
            series=(
                Reading(signal="spindle_rpm", legend="speed"),
                Reading(signal="spindle_load_pct", legend="load", unit="percent", right=True),
            ),
            unit="rotrpm",
        ),
    ),
)

FORCE = Board(
    uid="cnctwin-force",
    title="Cutting force",
    says="The mean tangential force that the spindle's power needs at its speed, with the tool changes.",
    marks=TOOL_CHANGES,
    panels=(
        Panel(
            title="Cutting force",
            says=f"{twin.CUTTING_FORCE_N}, inferred from load and speed; null where that means nothing. Marks: tool changes.",
            series=(Reading(signal=twin.CUTTING_FORCE_N, legend="force", shown=Shown.PEAK),),
            unit="forceN",
            width=24,
            height=12,
        ),
        Panel(
            title="What it is inferred from",
            says="Load, left, and speed, right.",
            series=(
                Reading(signal="spindle_load_pct", legend="load", shown=Shown.PEAK),
                Reading(signal="spindle_rpm", legend="speed", unit="rotrpm", right=True),
            ),
            unit="percent",
        ),
        Panel(title="Tool in the spindle", says="tool_number.", series=(_state("tool_number", "tool"),)),
    ),
)

GAP = Board(
    uid="cnctwin-gap",
    title="Gap",
    says="Twin minus measured: how large it stands, in which regime, whether it grows.",
    last="now-7d",
    refresh="1m",
    panels=(
        Panel(
            title="Growing",
            says=f"{twin.GAP_GROWING}: red from when some signal and regime has left what it was while healthy.",
            series=(_state(twin.GAP_GROWING, "gap"),),
            view=View.STATES,
            words=words.GROWTH,
            width=24,
            height=4,
        ),
        Panel(
            title="Standing gap by signal",
            says="rms over the floor: 1 is as good as a healthy machine repeats itself.",
            series=(Reading(signal=GAPS, legend="{}", many=True, hold_s=GAP_S),),
            limits=FLOOR,
            width=24,
            height=10,
        ),
        Panel(
            title="By regime",
            says="The same in one regime.",
            series=(
                Reading(
                    signal=f"{twin.GAP_PREFIX}(spindle_temp_c|spindle_load_pct)/(warm_up|steady|cool_down|air|cutting)",
                    legend="{}",
                    many=True,
                    hold_s=GAP_S,
                ),
            ),
            limits=FLOOR,
        ),
        Panel(
            title="Mean of twin minus measured",
            says="With its sign, in the unit of the signal.",
            series=(Reading(signal=f"{GAPS}/mean", legend="{}", many=True, hold_s=GAP_S),),
        ),
        Panel(
            title="Time in which nothing was compared",
            says=f"{twin.GAP_LEFT_OUT_PCT}: tool changes, settling, no regime, unknown inputs.",
            series=(Reading(signal=twin.GAP_LEFT_OUT_PCT, legend="left out", hold_s=GAP_S),),
            view=View.FIGURE,
            unit="percent",
            height=5,
        ),
    ),
)

BOARDS = (FLEET, MACHINE, ANOMALY, TEMPERATURE, FORCE, GAP)
