"""`cnctwin figures`: its options (`command.py`), and the table that a person reads (`shown.py`)."""
