"""The names of signals that the twin publishes and that more than one file reads, all below `twin/`.

Datatype, unit, meaning and provenance of each are in the `OutputSpec` of the processor that publishes it, which takes the name
from here. A name that only its own processor uses is spelled there.
"""

TWIN_PREFIX = "twin/"
CHALLENGER_PREFIX = f"{TWIN_PREFIX}challenger/"
"""The prefix of a challenger's signals; the rest of the name is that of the live twin's signal, below `twin/`."""

# thermal, cutting_force, residual, vibration
SPINDLE_TEMP_C = f"{TWIN_PREFIX}spindle_temp_c"
SPINDLE_TEMP_RESIDUAL_K = f"{TWIN_PREFIX}spindle_temp_residual_k"
SPINDLE_TEMP_RISE_K = f"{TWIN_PREFIX}spindle_temp_rise_k"
SPINDLE_TEMP_BASIS = f"{TWIN_PREFIX}spindle_temp_basis"
CUTTING_FORCE_N = f"{TWIN_PREFIX}cutting_force_n"
CUTTING_FORCE_BASIS = f"{TWIN_PREFIX}cutting_force_basis"
SPINDLE_TEMP_CORRECTION_K = f"{TWIN_PREFIX}spindle_temp_correction_k"
SPINDLE_TEMP_CORRECTED_C = f"{TWIN_PREFIX}spindle_temp_corrected_c"
SPINDLE_TEMP_CORRECTED_RESIDUAL_K = f"{TWIN_PREFIX}spindle_temp_corrected_residual_k"
RESIDUAL_BASIS = f"{TWIN_PREFIX}residual_basis"
VIBRATION_RMS_G = f"{TWIN_PREFIX}vibration_rms_g"
VIBRATION_VELOCITY_MM_S = f"{TWIN_PREFIX}vibration_velocity_mm_s"
VIBRATION_CREST_FACTOR = f"{TWIN_PREFIX}vibration_crest_factor"
VIBRATION_KURTOSIS = f"{TWIN_PREFIX}vibration_kurtosis"

# expected
EXPECTED_SPINDLE_LOAD_PCT = f"{TWIN_PREFIX}expected_spindle_load_pct"
EXPECTED_FEED_MM_MIN = f"{TWIN_PREFIX}expected_feed_mm_min"
EXPECTED_CUTTING_FORCE_N = f"{TWIN_PREFIX}expected_cutting_force_n"
EXPECTED_LINE_S = f"{TWIN_PREFIX}expected_line_s"
EXPECTED_CUT_LEAST_PCT = f"{TWIN_PREFIX}expected_cut_least_pct"
EXPECTED_CUT_MOST_PCT = f"{TWIN_PREFIX}expected_cut_most_pct"
EXPECTED_RATIO = f"{TWIN_PREFIX}expected_ratio"
EXPECTED_BASIS = f"{TWIN_PREFIX}expected_basis"
SPINDLE_CUT_LOAD_PCT = f"{TWIN_PREFIX}spindle_cut_load_pct"
SPINDLE_LOAD_RESIDUAL_PCT = f"{TWIN_PREFIX}spindle_load_residual_pct"

# tool_change_detector
TOOL_CHANGE_ACTIVE = f"{TWIN_PREFIX}tool_change_active"

# joint_anomaly
RAW_SCORE = f"{TWIN_PREFIX}raw_score"
ADJUSTED_SCORE = f"{TWIN_PREFIX}adjusted_score"
ANOMALY_THRESHOLD = f"{TWIN_PREFIX}anomaly_threshold"
ANOMALY_ALARM = f"{TWIN_PREFIX}anomaly_alarm"
ANOMALY_BASIS = f"{TWIN_PREFIX}anomaly_basis"
COMMON_MODE = f"{TWIN_PREFIX}common_mode"
TOOL_CHANGE_GATE = f"{TWIN_PREFIX}tool_change_gate"
GATED_SHARE_PCT = f"{TWIN_PREFIX}gated_share_pct"
SCORE_DRIFT = f"{TWIN_PREFIX}score_drift"
ANOMALY_WHY = f"{TWIN_PREFIX}anomaly_why"
"""JSON text while an alarm is on: the signal, the cut and how far from what was expected (twin/anomaly/parts/alarms/why.py)."""
ANOMALY_KNOWS = f"{TWIN_PREFIX}anomaly_knows"
ANOMALY_VERDICTS = f"{TWIN_PREFIX}anomaly_verdicts"
"""JSON text on change: the last alarms with who said what of them, and what follows from it (twin/anomaly/parts/alarms/)."""
CUT_RECORD = f"{TWIN_PREFIX}cut_record"
"""JSON text at the end of an operation of a part (twin/anomaly/parts/record.py)."""

# tool_wear
TOOL_WEAR_PCT = f"{TWIN_PREFIX}tool_wear_pct"
TOOL_WEAR_SLOPE_PCT = f"{TWIN_PREFIX}tool_wear_slope_pct"
TOOL_PARTS_LEFT = f"{TWIN_PREFIX}tool_parts_left"
TOOL_PARTS_LEFT_LOW = f"{TWIN_PREFIX}tool_parts_left_low"
TOOL_PARTS_LEFT_HIGH = f"{TWIN_PREFIX}tool_parts_left_high"
TOOL_WEARS_FAST = f"{TWIN_PREFIX}tool_wears_fast"
TOOL_WEAR_BASIS = f"{TWIN_PREFIX}tool_wear_basis"
TOOL_LIVES = f"{TWIN_PREFIX}tool_lives"
"""JSON text after each part: all tools with their wear and parts left (twin/wear/status.py)."""
MACHINE_DRIFT = f"{TWIN_PREFIX}machine_drift"
MACHINE_DRIFT_BASIS = f"{TWIN_PREFIX}machine_drift_basis"
MACHINE_DRIFT_FINDINGS = f"{TWIN_PREFIX}machine_drift_findings"
"""JSON text while the machine drifts: since when (ms), and by how many per cent (processors/tool_wear/drift.py)."""

# gap
GAP_PREFIX = f"{TWIN_PREFIX}gap_"
"""Followed by a signal: its standing gap; by a signal, a slash and a regime: the gap in that regime."""
GAP_GROWING = f"{GAP_PREFIX}growing"
GAP_GROWING_SIGNAL = f"{GAP_PREFIX}growing_signal"
GAP_FINDINGS = f"{GAP_PREFIX}findings"
"""JSON text: of each gap that grows signal, regime, way, by how much, unit, since when (ms), the largest first."""
GAP_OPEN = f"{GAP_PREFIX}open"
GAP_WINDOW = f"{GAP_PREFIX}window"
GAP_LEFT_OUT_PCT = f"{GAP_PREFIX}left_out_pct"
GAP_BASIS = f"{GAP_PREFIX}basis"
GAP_NOTES = frozenset({GAP_GROWING, GAP_GROWING_SIGNAL, GAP_FINDINGS, GAP_OPEN, GAP_WINDOW, GAP_LEFT_OUT_PCT, GAP_BASIS})
"""Metrics about the comparison, published beside the gaps themselves."""

# rules
RULE_PREFIX = f"{TWIN_PREFIX}rule_"
"""Followed by a rule: its alarm."""
RULE_LOAD_OVER_LIMIT = f"{RULE_PREFIX}load_over_limit"
RULE_THERMAL_RUNAWAY = f"{RULE_PREFIX}thermal_runaway"
RULE_LOAD_WITHOUT_FEED = f"{RULE_PREFIX}load_without_feed"
RULE_VIBRATION = f"{RULE_PREFIX}vibration"
RULE_TOOL_BROKEN = f"{RULE_PREFIX}tool_broken"
RULE_LOAD_OVER_EXPECTED = f"{RULE_PREFIX}load_over_expected"
RULES = (
    RULE_LOAD_OVER_LIMIT,
    RULE_THERMAL_RUNAWAY,
    RULE_LOAD_WITHOUT_FEED,
    RULE_VIBRATION,
    RULE_TOOL_BROKEN,
    RULE_LOAD_OVER_EXPECTED,
)
RULE_DETAIL = f"{RULE_PREFIX}detail"
RULE_FINDINGS = f"{RULE_PREFIX}findings"
"""JSON text: by the name of each rule that alarms value, limit, unit, since when (ms), and the signal to look at."""
SEVERITY = f"{TWIN_PREFIX}severity"

# control_alarms
CONTROL_ALARM = f"{TWIN_PREFIX}control_alarm"
CONTROL_ALARM_TEXT = f"{TWIN_PREFIX}control_alarm_text"
CONTROL_ALARM_FINDINGS = f"{TWIN_PREFIX}control_alarm_findings"
"""JSON text while it alarms: its severity (high, medium), and the NC line at which it came up, where that is known."""

# events
STOP_REASON = f"{TWIN_PREFIX}stop_reason"
PART_RECORD = f"{TWIN_PREFIX}part_record"

# production
OEE = f"{TWIN_PREFIX}oee"
AVAILABILITY = f"{TWIN_PREFIX}availability"
PERFORMANCE = f"{TWIN_PREFIX}performance"
QUALITY = f"{TWIN_PREFIX}quality"
PART_ENERGY_KWH = f"{TWIN_PREFIX}part_energy_kwh"
STOPS = f"{TWIN_PREFIX}stops"
"""JSON text: the stops of the shift by reason, each with its time element, seconds and count."""
PRODUCTION = f"{TWIN_PREFIX}production"
"""JSON text: the record of a shift that is over, or of a part that has ended (processors/production/record.py)."""
PRODUCTION_NOW = f"{TWIN_PREFIX}production_now"
"""JSON text: the record of the shift that runs, so far."""

# alerts
ALERT_STATE = f"{TWIN_PREFIX}alert_state"


def challenger_name(name: str) -> str:
    """Return the name under which a challenger publishes a signal of the live twin.

    >>> challenger_name("twin/spindle_temp_c")
    'twin/challenger/spindle_temp_c'
    """
    return CHALLENGER_PREFIX + name.removeprefix(TWIN_PREFIX)


def live_name(name: str) -> str | None:
    """Return the signal of the live twin for one of a challenger; None for all others.

    >>> live_name("twin/challenger/spindle_temp_c"), live_name("twin/spindle_temp_c")
    ('twin/spindle_temp_c', None)
    """
    return TWIN_PREFIX + name.removeprefix(CHALLENGER_PREFIX) if name.startswith(CHALLENGER_PREFIX) else None


def is_gap(name: str) -> bool:
    """Return True if a metric is the standing gap of a signal over all its regimes.

    >>> is_gap("twin/gap_spindle_rpm"), is_gap("twin/gap_spindle_load_pct/air"), is_gap("twin/gap_basis")
    (True, False, False)
    """
    return name.startswith(GAP_PREFIX) and "/" not in name[len(GAP_PREFIX) :] and name not in GAP_NOTES
