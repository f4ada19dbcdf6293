"""The dashboards that are drawn from what the runtime interface says at /metrics: the pipeline, and the validation."""

from dashboard_source import words
from dashboard_source.board import Board, Draw, Limit, Metric, Panel, View

FIGURES_OF_A_NIGHT = (
    ("Temperature: mean absolute error", "temperature", "mae|mae_worst_hour", "kelvin"),
    ("Temperature: root mean square error", "temperature", "rmse|rmse_worst_hour", "kelvin"),
    ("Cutting force: mean absolute percentage error", "force", "mape", "percent"),
    ("Vibration: correlation r", "vibration", "r", ""),
    ("Following error: root mean square", "following_error", "rms_pct", "percent"),
    ("Cycle time: error", "cycle_time", "error_pct", "percent"),
)
BAD_FROM_1 = (Limit(None, words.GREEN), Limit(1.0, words.RED))


def rising(yellow: float, red: float) -> tuple[Limit, ...]:
    return (Limit(None, words.GREEN), Limit(yellow, words.YELLOW), Limit(red, words.RED))


def lines(title: str, says: str, expression: str, legend: str, *, unit: str = "") -> Panel:
    return Panel(title=title, says=says, series=(Metric(expression=expression, legend=legend),), unit=unit, width=8)


def figure(title: str, says: str, expression: str, *, limits: tuple[Limit, ...] = BAD_FROM_1, unit: str = "") -> Panel:
    series = (Metric(expression=expression, legend=title),)
    return Panel(title=title, says=says, series=series, view=View.FIGURE, unit=unit, limits=limits, width=4, height=4)


def rate(name: str, by: str) -> str:
    return f"sum by ({by}) (rate({name}[$__rate_interval]))"


def _night(title: str, quantity: str, measure: str, unit: str) -> Panel:
    where = f'machine="$machine",quantity="{quantity}",measure=~"{measure}"'
    return Panel(
        title=title,
        says="Of each night; broken: the budget." + (" The least that r may be." if measure == "r" else ""),
        series=(
            Metric(expression=f"twin_validation{{{where}}}", legend="{{measure}}"),
            Metric(expression=f"twin_validation_budget{{{where}}}", legend="{{measure}}, budget", draw=Draw.BROKEN),
        ),
        unit=unit,
        width=8,
    )


ERRORS = 'twin_validation{machine="$machine",measure!="r"}'
CORRELATION = 'clamp_min(twin_validation{machine="$machine",measure="r"}, 0.001)'
VALIDATION = Board(
    uid="cnctwin-validation",
    title="Validation",
    says="The twin against ground truth, each night: cnctwin validate.",
    last="now-30d",
    refresh="5m",
    from_metrics=True,
    panels=(
        Panel(
            title="Share of the budget",
            says="Error over its budget; for r the budget over it. Above 1 it is missed.",
            series=(
                Metric(expression=f"abs({ERRORS}) / twin_validation_budget", legend="{{quantity}} {{measure}}"),
                Metric(expression=f"twin_validation_budget / {CORRELATION}", legend="{{quantity}} {{measure}}"),
            ),
            limits=rising(0.8, 1.0),
            unit="percentunit",
            width=16,
            height=9,
        ),
        Panel(
            title="Nights over budget, in a row",
            says="From two on a new model is to be trained.",
            series=(Metric(expression='twin_validation_nights_over_budget{machine="$machine"}', legend="nights"),),
            view=View.FIGURE,
            limits=rising(1.0, 2.0),
            width=4,
            height=9,
        ),
        Panel(
            title="Last validation",
            says="How long ago. More than a day and a half: the timer does not run.",
            series=(Metric(expression='time() - twin_validation_last_run_timestamp_seconds{machine="$machine"}', legend="age"),),
            view=View.FIGURE,
            unit="dtdurations",
            limits=rising(90_000.0, 129_600.0),
            width=4,
            height=9,
        ),
        *(_night(*figure) for figure in FIGURES_OF_A_NIGHT),
    ),
)

FIGURES = (
    figure("Machines offline", "Edges that have said goodbye, or were lost.", "sum(1 - twin_source_online)"),
    figure(
        "Oldest value",
        "Event time of the newest message until now, of the worst machine.",
        "max(twin_source_age_seconds)",
        limits=rising(30.0, 300.0),
        unit="s",
    ),
    figure("Ledger difference", "What is neither emitted, dropped nor buffered.", "max(abs(twin_ledger_difference))"),
    figure(
        "Store, days left",
        "Until the disk is full at the present rate.",
        "min(twin_store_days_left)",
        limits=(Limit(None, words.RED), Limit(7.0, words.YELLOW), Limit(30.0, words.GREEN)),
        unit="suffix: d",
    ),
    figure("Models missing", "Configured, and not there.", "sum(twin_model_missing)"),
    figure("Alerts firing", "Acknowledged ones too.", 'sum(twin_alerts{state=~"firing|acknowledged"})'),
)
LINES = (
    lines("Age of the newest value", "The one that fails quietly.", "twin_source_age_seconds", "{{machine}}", unit="s"),
    lines(
        "Dropped",
        "Each with its reason; none of it is silent.",
        rate("twin_dropped_total", "node, reason"),
        "{{node}} {{reason}}",
        unit="suffix: /s",
    ),
    lines("Emitted", "By each edge and processor.", rate("twin_emitted_total", "node"), "{{node}}", unit="suffix: /s"),
    lines(
        "Holes in sequences",
        "Messages that were lost on the way, by layer.",
        "sum by (layer, node) (increase(twin_seq_gaps_total[$__rate_interval]))",
        "{{node}} {{layer}}",
    ),
    lines("Lag of the processors", "Age of a message when it is folded.", "twin_processor_lag_seconds", "{{node}}", unit="s"),
    lines("Queues of the processors", "Messages behind the network thread.", "twin_processor_queue_depth", "{{node}}"),
    lines(
        "Unsaved state",
        "Age of the oldest state that has no snapshot yet.",
        "twin_state_checkpoint_age_seconds",
        "{{node}}",
        unit="s",
    ),
    lines("Buffered", "By each edge and processor.", "twin_buffer_depth", "{{node}}"),
    lines(
        "Store: samples", "Written a second.", "rate(twin_store_samples_total[$__rate_interval])", "samples", unit="suffix: /s"
    ),
    lines("Store: waiting", "Samples that are not on the disk yet.", "twin_store_waiting", "waiting"),
    lines("Store: size", "On the disk.", "twin_store_bytes", "bytes", unit="decbytes"),
    lines("Clocks", "Control minus edge.", "twin_clock_offset_seconds", "{{machine}}", unit="s"),
)
PIPELINE = Board(
    uid="cnctwin-pipeline",
    title="Pipeline",
    says="Is everything connected, in order and accounted for: received = emitted + dropped + buffered.",
    chooses_machine=False,
    last="now-3h",
    refresh="10s",
    from_metrics=True,
    panels=(
        *FIGURES,
        Panel(
            title="Machines",
            says="Online: the edge lives, and the control behind it answers.",
            series=(Metric(expression="twin_source_online", legend="{{machine}}"),),
            view=View.STATES,
            words=words.ONLINE,
            width=24,
            height=6,
        ),
        *LINES,
    ),
)

BOARDS = (PIPELINE, VALIDATION)
