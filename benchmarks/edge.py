"""What an edge costs: the store, a gateway of many machines, a day without a broker. The work is in `edge_runs.py`.

.venv/bin/python benchmarks/edge.py store|gateway|outage
"""

import sys
from importlib import import_module
from pathlib import Path

# A script finds its own folder first, and in it this file in place of the package `edge`: so that folder goes, and where it is a
# script beside this one that wants the package, it gets the package.
sys.path[:] = [str(Path(__file__).parents[1]), *(entry for entry in sys.path if Path(entry) != Path(__file__).parent)]
if __name__ == "edge":
    del sys.modules["edge"]
    import_module("edge")
elif __name__ == "__main__":
    import_module("benchmarks.edge_runs").main()
