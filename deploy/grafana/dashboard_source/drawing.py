"""The drawing of a dashboard: from its description to what Grafana reads.

What a store cannot know, the metrics of the runtime interface, is asked of Prometheus whatever the store.
"""

import json
import re
from dataclasses import dataclass
from itertools import count
from typing import Any

from grafana_foundation_sdk.builders import dashboard, prometheus, stat, statetimeline, timeseries
from grafana_foundation_sdk.builders.common import ReduceDataOptions, VizLegendOptions, VizTooltipOptions
from grafana_foundation_sdk.cog.builder import Builder
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.cog.variants import Dataquery
from grafana_foundation_sdk.models.common import (
    AxisPlacement,
    BigValueColorMode,
    DataSourceRef,
    LegendDisplayMode,
    LegendPlacement,
    SortOrder,
    TooltipDisplayMode,
    VisibilityMode,
)
from grafana_foundation_sdk.models.dashboard import (
    Dashboard,
    DashboardCursorSync,
    DashboardLinkType,
    DynamicConfigValue,
    FieldColorModeId,
    Threshold,
    ThresholdsMode,
    ValueMap,
    ValueMapping,
    ValueMappingResult,
    VariableRefresh,
    VariableSort,
)

from dashboard_source import influxql, promql
from dashboard_source.board import Board, Draw, Mark, Metric, Panel, Reading, View

METRICS = DataSourceRef(type_val="prometheus", uid="cnctwin-metrics")
SCREEN_POINTS = 600
GREY = "#8e8e8e"
BROKEN_LINE = {"fill": "dash", "dash": [8, 8]}


@dataclass(frozen=True, slots=True)
class _Ready(Builder[Dataquery]):
    """A query that is written already, in the form that the SDK asks for."""

    query: Dataquery

    def build(self) -> Dataquery:
        """Return the query as it is."""
        return self.query


class Source:
    """The store that is asked, and in which words."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.ref = DataSourceRef(type_val="influxdb" if kind == "influxdb" else "prometheus", uid="cnctwin-store")

    def query(self, series: Reading | Metric, letter: str) -> Builder[Dataquery]:
        """The query of one series."""
        if isinstance(series, Metric):
            return _prometheus(series.expression, series.legend, letter, METRICS)
        if self.kind == "influxdb":
            target = influxql.InfluxTarget(
                query=influxql.of_reading(series), alias=influxql.legend(series), ref_id=letter, datasource=self.ref
            )
            return _Ready(target)
        return _prometheus(promql.of_reading(series), promql.legend(series), letter, self.ref)

    def mark(self, mark: Mark) -> dashboard.AnnotationQuery:
        """An annotation."""
        drawn = dashboard.AnnotationQuery().name(mark.name).datasource(self.ref).enable(True).icon_color(mark.colour)
        if self.kind == "influxdb":
            query = influxql.of_mark(mark)
            return drawn.target(
                _Ready(influxql.InfluxTarget(query=query, ref_id="Anno", datasource=self.ref, is_annotation=True))
            )
        return drawn.target(_prometheus(promql.of_mark(mark), "", "Anno", self.ref)).title_format(mark.name)

    def machines(self, *, from_metrics: bool) -> dashboard.QueryVariable:
        """The list of machines at the top."""
        query = promql.MACHINES_OF_METRICS if from_metrics else influxql.MACHINES if self.kind == "influxdb" else promql.MACHINES
        chosen = dashboard.QueryVariable("machine").label("Machine").datasource(METRICS if from_metrics else self.ref)
        return chosen.query(query).refresh(VariableRefresh.ON_TIME_RANGE_CHANGED).sort(VariableSort.ALPHABETICAL_ASC)


def _prometheus(expression: str, legend: str, letter: str, source: DataSourceRef) -> Builder[Dataquery]:
    return prometheus.Dataquery().expr(expression).legend_format(legend).ref_id(letter).datasource(source).range()


def _overrides(panel: Panel) -> dict[str, list[DynamicConfigValue]]:
    """Return, by legend, how a series differs from the others of its panel."""
    drawn: dict[str, list[DynamicConfigValue]] = {}
    for series in panel.series:
        properties: dict[str, Any] = {"unit": series.unit} if series.unit else {}
        if series.right:
            properties |= {"custom.axisPlacement": AxisPlacement.RIGHT, "custom.axisLabel": series.legend}
        if series.draw is Draw.BROKEN:
            properties["custom.lineStyle"] = BROKEN_LINE
        if series.draw in (Draw.STEP, Draw.SHADE) and panel.view is View.LINES:
            properties["custom.lineInterpolation"] = "stepAfter"
        if series.draw is Draw.SHADE:
            shade = {"custom.lineWidth": 0, "custom.fillOpacity": 25, "custom.axisPlacement": AxisPlacement.HIDDEN}
            properties |= {**shade, "min": 0, "max": 1, "color": {"mode": "fixed", "fixedColor": GREY}}
        if properties:
            drawn[series.legend] = [DynamicConfigValue(name, value) for name, value in properties.items()]
    return drawn


def _thresholds(panel: Panel) -> dashboard.ThresholdsConfig:
    steps = [Threshold(value=limit.at, color=limit.colour) for limit in panel.limits]
    return dashboard.ThresholdsConfig().mode(ThresholdsMode.ABSOLUTE).steps(steps)


def _mappings(panel: Panel) -> list[ValueMapping]:
    return [
        ValueMap({f"{number:g}": ValueMappingResult(text=word, color=colour, index=place)})
        for place, (number, word, colour) in enumerate(panel.words)
    ]


def _view(panel: Panel) -> "timeseries.Panel | statetimeline.Panel | stat.Panel":
    legend = VizLegendOptions().display_mode(LegendDisplayMode.LIST).placement(LegendPlacement.BOTTOM).show_legend(True)
    tooltip = VizTooltipOptions().mode(TooltipDisplayMode.MULTI).sort(SortOrder.DESCENDING)
    if panel.view is View.STATES:
        states = statetimeline.Panel().legend(legend).tooltip(tooltip).show_value(VisibilityMode.AUTO).merge_values(True)
        states = states.row_height(0.8).fill_opacity(80).line_width(0)
        return states.color_scheme(dashboard.FieldColor().mode(FieldColorModeId.FIXED).fixed_color("transparent"))
    if panel.view is View.FIGURE:
        return stat.Panel().reduce_options(ReduceDataOptions().calcs(["lastNotNull"])).color_mode(BigValueColorMode.VALUE)
    lines = timeseries.Panel().legend(legend).tooltip(tooltip).line_width(1.5).fill_opacity(0)
    return lines.show_points(VisibilityMode.AUTO).insert_nulls(False)


def _panel(panel: Panel, source: Source, number: int) -> "timeseries.Panel | statetimeline.Panel | stat.Panel":
    drawn = _view(panel).id(number).title(panel.title).description(panel.says).span(panel.width).height(panel.height)
    drawn = drawn.max_data_points(SCREEN_POINTS).datasource(METRICS if isinstance(panel.series[0], Metric) else source.ref)
    for letter, series in zip("ABCDEFGHIJKL", panel.series, strict=False):
        drawn = drawn.with_target(source.query(series, letter))
    if panel.unit:
        drawn = drawn.unit(panel.unit)
    if panel.words:
        drawn = drawn.mappings(_mappings(panel))
    if panel.limits:
        drawn = drawn.thresholds(_thresholds(panel))
    for legend, properties in _overrides(panel).items():
        if "{" in legend:  # of several series: what is filled in may be anything
            pattern = ".*".join(map(re.escape, re.split(r"\{+\w*\}+", legend)))
            drawn = drawn.override_by_regexp(f"/^{pattern}$/", properties)
        else:
            drawn = drawn.override_by_name(legend, properties)
    return drawn


def draw(board: Board, source: Source) -> str:
    """The JSON of a dashboard."""
    drawn = dashboard.Dashboard(board.title).uid(board.uid).description(board.says).tags(["cnctwin"]).readonly()
    drawn = drawn.time(board.last, "now").refresh(board.refresh).timezone("browser").tooltip(DashboardCursorSync.CROSSHAIR)
    drawn = drawn.links([dashboard.DashboardLink("cnctwin").type(DashboardLinkType.DASHBOARDS).tags(["cnctwin"]).keep_time(True)])
    if board.chooses_machine:
        drawn = drawn.with_variable(source.machines(from_metrics=board.from_metrics))
    for mark in board.marks:
        drawn = drawn.annotation(source.mark(mark))
    numbers = count(1)
    for panel in board.panels:
        drawn = drawn.with_panel(_panel(panel, source, next(numbers)))
    return _text(drawn.build())


def _text(drawn: Dashboard) -> str:
    """Return the text, which shows a change as a change. The SDK puts links and annotations into a menu; they stay in sight."""
    document = json.loads(json.dumps(drawn, cls=JSONEncoder))
    for shown in (*document.get("links", ()), *document.get("annotations", {}).get("list", ())):
        shown.pop("placement", None)
    return json.dumps(document, indent=2, sort_keys=True) + "\n"
