"""The kinds of jobs: what each takes, and which function does it. Another kind is another entry."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cnctwin.errors import UsageError
from cnctwin.jobs.files_root import TOML_BYTES_MAX, FilesRoot, machine_name
from twin.errors import MachineError
from twin.machine import machine_from_toml

Text = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Parameters(BaseModel):
    """The keys of a request beyond job, id and reply_to; nothing but the keys that exist, nothing of another type."""

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
    """As `cnctwin optimise`: a program and a machine, each as a file or as its text.

    encoding, name: of the file that program_text came from; the answer is written in the one and told under the other
    """

    program: Text | None = None
    program_text: Text | None = None
    encoding: Literal["utf-8", "utf-8-sig", "latin-1"] | None = None
    name: Annotated[str, Field(min_length=1, max_length=120)] | None = None
    machine: Text | None = None
    machine_toml: Text | None = None
    objective: Literal["time", "cost", "pareto"] = "time"
    force_limit_n: Positive | None = None
    probability: Annotated[float, Field(ge=0.5, le=0.9999)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    evolutions: Annotated[int, Field(ge=1, le=100_000)] | None = None
    population: Annotated[int, Field(ge=4, le=10_000, multiple_of=2)] | None = None
    speed_changes: Literal["anywhere", "in_air", "per_tool"] | None = None

    @model_validator(mode="after")
    def _one_of_each(self) -> "OptimiseParameters":
        for file, text in (("program", "program_text"), ("machine", "machine_toml")):
            if (getattr(self, file) is None) == (getattr(self, text) is None):
                raise ValueError(f"give either {file} (a file) or {text}")
        if self.program_text is None and (self.encoding is not None or self.name is not None):
            raise ValueError("encoding and name are those of program_text; a file has its own")
        if self.encoding is not None and self.program_text is not None:
            try:
                self.program_text.encode(self.encoding)
            except UnicodeEncodeError as error:
                sign = self.program_text[error.start]
                raise ValueError(f"program_text has the sign {sign!r}, which {self.encoding} does not have") from None
        return self

    def machine_of(self, files: FilesRoot) -> str:
        """That of the machine.toml; the program is looked at too, and whether the machine states what is chosen between."""
        self.program_of(files)
        where = "machine_toml" if self.machine is None else f"machine = {self.machine!r}"
        try:
            machine = machine_from_toml(self.toml_of(files), where)
        except MachineError as error:
            raise UsageError(str(error)) from None
        if machine.limits is None:
            raise UsageError(f"{where}: no [limits]; write feed_mm_min and spindle_rpm, what machine and tool allow")
        if machine.cost is None and self.objective != "time":
            raise UsageError(f"{where}: no [cost], which objective = {self.objective!r} needs")
        return machine.machine.name

    def program_of(self, files: FilesRoot) -> str:
        """The text of the program."""
        return self.program_text or files.text(self.program or "", "program")

    def encoding_of(self, files: FilesRoot) -> str:
        """In which its file is written, and so is the rewritten one."""
        return self.encoding or "utf-8" if self.program_text else files.encoded_text(self.program or "", "program")[1]

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
