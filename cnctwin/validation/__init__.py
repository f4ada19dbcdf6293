"""The twin against ground truth, night by night: temperature, force, vibration, following error, cycle time; and budgets."""
