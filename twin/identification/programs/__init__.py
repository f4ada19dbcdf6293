"""Identification from recordings of part programs: where a machine spends its time."""
