"""Sealed hours: what is no longer new, in Parquet, and how it is written, found and read."""
