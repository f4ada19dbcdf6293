"""Runners, which go on until they are stopped: edges by their files; processors, with the courier and the store beside them."""
