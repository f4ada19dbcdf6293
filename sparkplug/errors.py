"""Errors of this package.

SparkplugError
├── TopicError            a topic or an id that the specification does not allow
├── PayloadError          bytes that are no Sparkplug payload, or a payload that breaks a rule
│   └── MetricValueError  a value that its datatype cannot carry
├── UnknownMetricError    a metric that the birth certificate does not declare
├── BrokerAddressError    an address of a broker that cannot be used
└── AnotherRunsError      another process has the name that this one wants
"""


class SparkplugError(Exception):
    """The root of all errors of this package."""


class TopicError(SparkplugError):
    """A topic or an id that the specification does not allow."""


class PayloadError(SparkplugError):
    """Bytes that are no Sparkplug payload, or a payload that breaks a rule."""


class MetricValueError(PayloadError):
    """A value that its datatype cannot carry."""


class UnknownMetricError(SparkplugError):
    """A metric that the birth certificate does not declare."""


class BrokerAddressError(SparkplugError):
    """An address of a broker that cannot be used."""


class AnotherRunsError(SparkplugError):
    """Another process has the name that this one wants."""
