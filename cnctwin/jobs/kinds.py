"""The kinds of jobs: what each takes, and which function does it. Another kind is another entry."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cnctwin.jobs.files_root import TOML_BYTES_MAX, FilesRoot, machine_name

Text = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Parameters(BaseModel):
    """What a request says beyond job, id and reply_to; nothing but the keys that exist, nothing of another type."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def machine_of(self, files: FilesRoot) -> str:
        """The name of the machine that it concerns, empty where it states none. Raises UsageError where a file is not there."""
        raise NotImplementedError


class CaseParameters(Parameters):
    """A folder with a case.toml, a machine.toml and recorded runs."""

    case: Text

    def machine_of(self, files: FilesRoot) -> str:
        """That of its machine.toml."""
        return machine_name(files.case(self.case, "case")[1], f"case = {self.case!r}: machine")


class IdentifyParameters(CaseParameters):
    """As `cnctwin identify`."""

    free_gains: bool = False


class OptimiseParameters(Parameters):
    """As `cnctwin optimise`: a program and a machine, each as a file or as its text."""

    program: Text | None = None
    program_text: Text | None = None
    machine: Text | None = None
    machine_toml: Text | None = None
    objective: Literal["time", "cost", "pareto"] = "time"
    force_limit_n: Positive | None = None
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    evolutions: Annotated[int, Field(ge=1, le=100_000)] | None = None
    population: Annotated[int, Field(ge=4, le=100_000)] | None = None

    @model_validator(mode="after")
    def _one_of_each(self) -> "OptimiseParameters":
        for file, text in (("program", "program_text"), ("machine", "machine_toml")):
            if (getattr(self, file) is None) == (getattr(self, text) is None):
                raise ValueError(f"give either {file} (a file) or {text}")
        return self

    def machine_of(self, files: FilesRoot) -> str:
        """That of the machine.toml; the program is looked at too."""
        self.program_of(files)
        return machine_name(self.toml_of(files), "machine_toml" if self.machine is None else f"machine = {self.machine!r}")

    def program_of(self, files: FilesRoot) -> str:
        """The text of the program."""
        return self.program_text or files.text(self.program or "", "program")

    def encoding_of(self, files: FilesRoot) -> str:
        """In which its file is written, and so is the rewritten one."""
        return "utf-8" if self.program_text else files.encoded_text(self.program or "", "program")[1]

    def toml_of(self, files: FilesRoot) -> str:
        """The text of the machine.toml."""
        return self.machine_toml or files.text(self.machine or "", "machine", TOML_BYTES_MAX)


@dataclass(frozen=True, slots=True)
class Kind:
    """work: `module:function`, loaded only in the process that does it; see `Bench` in cnctwin/jobs/work.py."""

    name: str
    parameters: type[Parameters]
    work: str


KINDS = {
    kind.name: kind
    for kind in (
        Kind("optimise", OptimiseParameters, "cnctwin.jobs.work:optimise"),
        Kind("identify", IdentifyParameters, "cnctwin.jobs.work:identify"),
        Kind("diagnose", CaseParameters, "cnctwin.jobs.work:diagnose"),
    )
}
