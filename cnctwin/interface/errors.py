"""The errors of the Python interface, in one tree; the text of each is the line that the command of the same name prints.

ApplicationError             (cnctwin/errors.py)
├── UsageError               input that cannot be used; it names the culprit, the value and the way out
│   ├── ProgramError         a part program that the control would refuse: `line`, `word`
│   ├── MachineError         a machine.toml that does not describe a machine, or an effect that does not fit
│   ├── RunError             a recording that is not a run log
│   ├── CaseError            a case folder that is not a case
│   ├── BrokerError          a broker that cannot be used or is silent
│   └── MissingPackageError  a package that this installation lacks, and the extra that brings it
├── LimitsError              limits that no feed and speed can keep: bad news, no wrong input
└── StoreError               a store that cannot do what it is asked (cnctwin/memory/store/contract.py)
"""

from collections.abc import Iterator
from contextlib import contextmanager

import edge.errors
import processors.errors
import sparkplug.errors
import twin.errors
from cnctwin.errors import ApplicationError, UsageError


class ProgramError(UsageError):
    """A part program that the control would refuse. line: as an editor counts; word: as written, empty for a whole block."""

    def __init__(self, text: str, line: int, word: str) -> None:
        self.line, self.word = line, word
        super().__init__(text)


class MachineError(UsageError):
    """A machine that is not described so that it can be used."""


class RunError(UsageError):
    """A recording that is not a run log."""


class CaseError(UsageError):
    """A case folder that is not a case."""


class BrokerError(UsageError):
    """A broker that cannot be used, or is silent."""


class LimitsError(ApplicationError):
    """Limits that no feed and speed can keep."""


_PUBLIC: tuple[tuple[type[Exception], type[ApplicationError]], ...] = (
    (twin.errors.MachineError, MachineError),
    (twin.errors.EffectError, MachineError),
    (twin.errors.RunLogError, RunError),
    (twin.errors.CaseError, CaseError),
    (sparkplug.errors.SparkplugError, BrokerError),
)
_EXPECTED = (twin.errors.TwinError, sparkplug.errors.SparkplugError, edge.errors.EdgeError, processors.errors.ProcessorError)


@contextmanager
def one_tree(culprit: str = "") -> Iterator[None]:
    """Let errors of the packages below leave as errors of the interface; those of a part program name it: `culprit`.

    >>> with one_tree("part.nc"):
    ...     raise twin.errors.PartProgramError(3, "G123", "is not known")
    Traceback (most recent call last):
    cnctwin.interface.errors.ProgramError: part.nc: line 3: G123: is not known
    """
    try:
        yield
    except twin.errors.PartProgramError as error:
        raise ProgramError(_named(culprit, error), error.line, error.word) from error
    except twin.errors.LimitsError as error:
        raise LimitsError(_named(culprit, error)) from error
    except _EXPECTED as error:
        public = next((ours for theirs, ours in _PUBLIC if isinstance(error, theirs)), UsageError)
        raise public(str(error)) from error


def _named(culprit: str, error: Exception) -> str:
    return f"{culprit}: {error}" if culprit else str(error)
