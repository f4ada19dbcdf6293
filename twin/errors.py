"""The errors of the twin, in one tree. Each message names the culprit, its value and the way out.

TwinError
├── PartProgramError  a part program that the control would refuse: line, word, reason
├── MachineError      a machine.toml that does not describe a machine
├── RunLogError       a recording that is not a run log
├── CaseError         a case folder that is not a case
├── EngagementError   a path, tool, stock or limit with which the engagement cannot be computed
├── EffectError       an effect that does not exist, or is given what it does not take
├── OptimisationError a program in which nothing may be changed, or an optimisation that is asked for what there is not
│   └── LimitsError   a program whose limits no feed and speed can keep
├── ExpectationError a file that holds no expectation of a program, or a damaged one
├── ModelError        an anomaly model that cannot be trained, read or used (twin/anomaly/errors.py)
├── ResidualError     a residual model that cannot be trained, read or used (twin/residual/errors.py)
├── PointerError      a current.json that names no model (twin/models/errors.py)
├── ForestError       arrays that are no forest, or a row that it cannot score (twin/forest/errors.py)
└── TransientError    a tool-change detector that cannot be learned, read or used (twin/transient/errors.py)
"""


class TwinError(ValueError):
    """Base of all: the input is at fault, and the message says which part of it."""


class MachineError(TwinError):
    """A machine description that cannot be used."""


class RunLogError(TwinError):
    """A recording whose columns or values are not those of a run log."""


class CaseError(TwinError):
    """A case folder that cannot be read."""


class EngagementError(TwinError):
    """A path, tool, stock or limit with which the engagement cannot be computed."""


class EffectError(TwinError):
    """An effect, or a parameter of one, that does not exist or is out of its bounds."""


class OptimisationError(TwinError):
    """A program in which nothing may be changed, or a question that cannot be put."""


class LimitsError(OptimisationError):
    """Limits that leave a line nothing: the answer is bad news, the question was not wrong."""


class ExpectationError(TwinError):
    """An expectation that cannot be read or written."""


class PartProgramError(TwinError):
    """A part program that cannot be run.

    line: 1-based, as an editor counts
    word: the word at fault, as written; empty where a whole block is
    reason: what is wrong with it and the way out
    program: name of the text that the line is in; None = the main program
    block: number of the line's block, where the control shows that number and not the line
    """

    def __init__(self, line: int, word: str, reason: str, program: str | None = None, block: int | None = None) -> None:
        self.line, self.word, self.reason, self.program, self.block = line, word, reason, program, block
        where = f"line {line}" if block is None else f"block {block} (line {line})"
        where = where if program is None else f"{program}, {where}"
        super().__init__(f"{where}: {word + ': ' if word else ''}{reason}")
