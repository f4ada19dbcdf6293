"""A pandas DataFrame of an Arrow table, with the units of its columns in `attrs["units"]`."""

from typing import TYPE_CHECKING

import pyarrow as pa

from cnctwin.processes.extras import needed_by

if TYPE_CHECKING:
    import pandas as pd


def frame_of(table: pa.Table, index: str) -> "pd.DataFrame":
    """Return the frame of a table, by its column `index`. Raises MissingPackageError where there is no pandas."""
    with needed_by("a frame", "notebook"):
        import pandas as pd  # noqa: PLC0415  which to_pandas imports, and may not be there
    frame: pd.DataFrame = table.to_pandas().set_index(index)
    frame.attrs["units"] = units_of(table)
    return frame


def units_of(table: pa.Table) -> dict[str, str]:
    """Return the unit of each column that states one."""
    return {field.name: field.metadata[b"unit"].decode() for field in table.schema if b"unit" in (field.metadata or {})}
