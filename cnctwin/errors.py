"""The errors of the program.

ApplicationError
├── UsageError         wrong input: exit code 2
│   └── MissingPackageError  a package that this installation lacks (an ImportError, too)
├── BrokerStartError   the private broker cannot be started
└── SpreadError        pieces of a job that are lost: nobody is there to compute them, or each who tried was killed
"""


class ApplicationError(Exception):
    """The root of all errors of this package; its text is the one line that a user sees."""


class UsageError(ApplicationError):
    """Input that cannot be used, with the way out."""


class MissingPackageError(UsageError, ImportError):
    """A package that this installation lacks, with the extra that brings it."""


class BrokerStartError(ApplicationError):
    """The private broker cannot be started."""


class SpreadError(ApplicationError):
    """Pieces of a job that are lost: nobody is there to compute them, or each who tried was killed."""
