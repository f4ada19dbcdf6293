"""Queries to InfluxDB, in InfluxQL: version 2 answers it at /query, where a bucket is a database of its name.

Not Flux: InfluxQL runs on what Debian has, so the tests try each query; Flux could not be tried. `fill(previous)` draws a value
on until it is told again, from its first sample in the range on; what was before the range, and that a value has become bad, is
not seen here: the panel of qualities says that.
"""

from dataclasses import dataclass

from grafana_foundation_sdk.cog.variants import Dataquery
from grafana_foundation_sdk.models.dashboard import DataSourceRef

from dashboard_source.board import RAW, Mark, Reading

MACHINES = f'SHOW TAG VALUES ON "{RAW}" WITH KEY = "machine"'


@dataclass(frozen=True, slots=True, kw_only=True)
class InfluxTarget(Dataquery):
    """A query in words for Grafana's data source for InfluxDB; the SDK has none."""

    query: str
    ref_id: str
    datasource: DataSourceRef
    alias: str = ""
    is_annotation: bool = False

    def to_json(self) -> dict[str, object]:
        """Return the query as Grafana keeps it."""
        common: dict[str, object] = {"datasource": self.datasource, "query": self.query, "refId": self.ref_id}
        if self.is_annotation:
            return {**common, "fromAnnotations": True, "rawQuery": True, "titleColumn": "", "textColumn": "", "tagsColumn": ""}
        return {**common, "alias": self.alias, "rawQuery": True, "resultFormat": "time_series"}


def _from(measurement: str) -> str:
    return f'"{measurement}".."{measurement}"'


def _where(signal: str, *, many: bool = False, fleet: bool = False) -> str:
    machine = "" if fleet else '"machine" =~ /^${machine:regex}$/ AND '
    matches = f"=~ /^{signal.replace('/', chr(92) + '/')}$/" if many else f"= '{signal}'"
    return f'{machine}"signal" {matches} AND $timeFilter'


def of_reading(reading: Reading) -> str:
    """The query of a series."""
    field = "quality" if reading.quality else "value"
    where = _where(reading.signal, many=reading.many, fleet=reading.fleet)
    selected = f'{reading.shown.value}("{field}") FROM {_from(reading.measurement)} WHERE {where}'
    return f'SELECT {selected} GROUP BY time($__interval), "{reading.told_apart_by}" fill(previous)'


def of_mark(mark: Mark) -> str:
    """The query of an annotation: rows only where something is to be marked; of a stretch its beginning."""
    changed = "> 0" if mark.stretch else "<> 0"
    differences = f'difference("value") AS "change" FROM {_from(mark.measurement)} WHERE {_where(mark.signal)}'
    return f'SELECT "change" FROM (SELECT {differences}) WHERE "change" {changed}'  # noqa: S608  all names are ours


def legend(reading: Reading) -> str:
    """The legend, in InfluxQL's form."""
    return reading.legend.replace("{}", f"$tag_{reading.told_apart_by}")
