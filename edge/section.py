"""A table of a configuration file."""

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A table of the file: nothing that it does not know, nothing that changes later."""

    model_config = ConfigDict(extra="forbid", frozen=True)
