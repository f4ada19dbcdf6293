"""The next experiment: short, safe programs that would tell apart what the recordings cannot."""
