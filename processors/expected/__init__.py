"""The twin's expectation of the line that runs, and what is measured beside it. `processor.py` declares the processor."""
