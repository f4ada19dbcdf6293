"""The Grafana dashboards as code: what they show (boards), how it is asked (promql, influxql), how it is drawn (drawing).

`scripts/dashboards` writes the JSON of it.
"""
