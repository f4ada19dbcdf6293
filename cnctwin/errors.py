"""What can go wrong in the program.

ProgramError
├── UsageError         wrong input: exit code 2
├── BrokerStartError   the private broker cannot be started
└── SpreadError        pieces of a job that are lost: nobody is there to compute them, or each who tried was killed
"""


class ProgramError(Exception):
    """The root of all errors of this package; its text is the one line that a user sees."""


class UsageError(ProgramError):
    """Input that cannot be used, with the way out."""


class BrokerStartError(ProgramError):
    """The private broker cannot be started."""


class SpreadError(ProgramError):
    """Pieces of a job that are lost: nobody is there to compute them, or each who tried was killed."""
