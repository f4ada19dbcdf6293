"""Identification: the constants of a machine from recordings of it, with intervals, and what the recordings cannot say."""
