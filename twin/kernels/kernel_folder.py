"""The folder of compiled kernels, so that each is compiled once on a machine.

`$CNCTWIN_KERNELS`, else `$XDG_CACHE_HOME/cnctwin/kernels`, else `~/.cache/cnctwin/kernels`; where that cannot be written, a
folder of this process. The folder is its owner's alone: numba trusts what it has kept there. It holds the newest few hundred
kernels and no more.
"""

import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

KERNELS_MAX = 400
VERSIONS_MAX = 6


@cache
def kernel_folder() -> Path:
    """The folder, made where there is none."""
    cache_home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("CNCTWIN_KERNELS") or Path(cache_home) / "cnctwin" / "kernels")
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        own = getattr(os, "getuid", None)  # Windows has no owner to compare; the folder is below the user's own
        if (own is None or folder.stat().st_uid == own()) and os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="cnctwin-kernels-"))


def keep_newest(paths: list[Path], most: int) -> None:
    """Removes all but the newest `most` of these files or folders; what another process removes first is gone as well."""
    aged = sorted(((path.stat().st_mtime, path) for path in paths if path.exists()), reverse=True)
    for _, path in aged[most:]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
