"""Anomaly scores of a cell, judged beside the peers. `processor.py` declares the processor."""
