"""Rules for an instance of a template and its definition (Sparkplug 3.0.0, 6.4.15).

A birth carries every member of the definition, data may carry some of them; neither may carry a member or a parameter that the
definition has not. The next birth is whole again: a part is merged into what was known.
"""

from collections.abc import Mapping
from dataclasses import replace

from sparkplug.errors import MetricValueError
from sparkplug.values import Template

Definitions = Mapping[str, Template]


def check_instance(instance: Template, definitions: Definitions, *, whole: bool) -> None:
    """Raise MetricValueError where an instance does not fit its definition; `whole`: it has to have every member."""
    if instance.is_definition:
        raise MetricValueError("a template definition belongs into the templates of the node, not into a metric")
    definition = definitions.get(instance.ref or "")
    if definition is None:
        known = ", ".join(sorted(definitions)) or "none"
        raise MetricValueError(f"the template {instance.ref!r} is not defined; the node defines {known}")
    members = {metric.name for metric in definition.metrics}
    has = {metric.name for metric in instance.metrics}
    if has - members:
        raise MetricValueError(f"{sorted(map(str, has - members))} are no members of the template {instance.ref!r}")
    if whole and members - has:
        raise MetricValueError(f"the members {sorted(map(str, members - has))} of the template {instance.ref!r} are missing")
    parameters = {parameter.name for parameter in definition.parameters}
    strange = [parameter.name for parameter in instance.parameters if parameter.name not in parameters]
    if strange:
        raise MetricValueError(f"{strange} are no parameters of the template {instance.ref!r}")


def merged(past: Template, part: Template) -> Template:
    """The whole instance after data that carried a part of its members.

    Members that the part does not carry keep their values, and so do parameters.
    """
    metrics = {metric.name: metric for metric in (*past.metrics, *part.metrics)}
    parameters = {parameter.name: parameter for parameter in (*past.parameters, *part.parameters)}
    return replace(part, metrics=tuple(metrics.values()), parameters=tuple(parameters.values()))
