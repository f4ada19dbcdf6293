"""The exceptions of this package.

ProcessorError
├── DeclarationError      a processor is declared in a way that the contract does not allow
├── UnknownProcessorError no file of that name declares a processor
├── ConfigurationError    a configuration file that cannot be read, or holds what the model does not allow
├── OutputError           a step returned what its processor does not declare: our own bug
├── SnapshotError         a snapshot that cannot be restored
└── ProcessorsFailedError all processors of a process go on failing
"""


class ProcessorError(Exception):
    """The root of all errors of this package."""


class DeclarationError(ProcessorError):
    """A processor is declared in a way that the contract does not allow."""


class UnknownProcessorError(ProcessorError):
    """No file of that name declares a processor."""


class ConfigurationError(ProcessorError):
    """A configuration file that cannot be read, or holds what the model does not allow."""


class OutputError(ProcessorError):
    """A step returned what its processor does not declare: our own bug."""


class SnapshotError(ProcessorError):
    """A snapshot that cannot be restored."""


class ProcessorsFailedError(ProcessorError):
    """All processors of a process go on failing."""
