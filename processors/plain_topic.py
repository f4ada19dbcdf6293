"""Names as levels of a plain MQTT topic."""

_ESCAPES = str.maketrans({"%": "%25", "+": "%2B", "#": "%23", "\0": "%00"})


def topic_path(name: str) -> str:
    """A metric name in a topic; its slashes stay levels. No two names give the same topic.

    >>> topic_path("twin/cutting_force_n"), topic_path("load+trend #1")
    ('twin/cutting_force_n', 'load%2Btrend %231')
    """
    return name.translate(_ESCAPES)


def topic_level(name: str) -> str:
    """A machine's name as one level of a topic.

    >>> topic_level("cell 4/mill")
    'cell 4%2Fmill'
    """
    return topic_path(name).replace("/", "%2F")
