"""The bounds of what a host application lets in. What is beyond them is refused and counted, and costs nobody else anything.

Names become levels of plain MQTT topics, where `%`, `+`, `#` and a device's `/` take three bytes each; an MQTT topic has at most
65,535 bytes, and Mosquitto takes at most 200 levels.
"""

from dataclasses import dataclass, fields

DAY_MS = 86_400_000


@dataclass(frozen=True, slots=True)
class Limits:
    """See the module. Trusted nodes are free of the bounds on numbers and rates, not of those on names, stamps and sizes.

    id_bytes_max: group, edge node or device, in a topic
    name_bytes_max, name_levels_max: a metric name in a topic, and its levels
    text_bytes_max: a text, a unit, the reason of a quality
    value_bytes_max: an array, bytes, a dataset or a template
    metrics_a_device_max: a control declares some hundred; a processor's row holds 5,000
    devices_a_node_max: a quarter of the machines that a process folds, so that no edge takes all of the room
    metrics_a_node_max, births_a_node_bytes_max: what a node and its devices declare altogether, and the size of these births
    ahead_ms_max: how far a time stamp may lie ahead of the host's clock: a control that says its local time is up to 14 h ahead
    oldest_ms: the oldest time stamp, since 1970; recordings are imported, and the clock of a control may begin at 1970
    messages_a_second_max, messages_at_once_max: data messages of a node, for long and in one go (what an edge sends late, too)
    data_bytes_a_second_max, data_bytes_at_once_max: their size
    births_a_second_max, births_at_once_max: births and deaths of a node, which count for themselves: a thousand devices may be
        born at once, again and again
    birth_bytes_a_second_max, birth_bytes_at_once_max: their size
    plain_bytes_max: a message outside Sparkplug
    """

    id_bytes_max: int = 255
    name_bytes_max: int = 1024
    name_levels_max: int = 64
    text_bytes_max: int = 64 * 1024
    value_bytes_max: int = 1024 * 1024
    metrics_a_device_max: int = 2000
    metrics_a_node_max: int = 50_000
    births_a_node_bytes_max: int = 32 * 1024 * 1024
    devices_a_node_max: int = 250
    nodes_a_group_max: int = 2000
    ahead_ms_max: int = DAY_MS
    oldest_ms: int = 0
    messages_a_second_max: int = 1000
    messages_at_once_max: int = 10_000
    data_bytes_a_second_max: int = 8 * 1024 * 1024
    data_bytes_at_once_max: int = 64 * 1024 * 1024
    births_a_second_max: int = 100
    births_at_once_max: int = 5000
    birth_bytes_a_second_max: int = 1024 * 1024
    birth_bytes_at_once_max: int = 32 * 1024 * 1024
    plain_bytes_max: int = 16 * 1024 * 1024

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            least = 0 if field.name == "oldest_ms" else 1
            if type(value) is not int or value < least:
                raise ValueError(f"{field.name} = {value!r} is no whole number from {least}")


DEFAULTS = Limits()
