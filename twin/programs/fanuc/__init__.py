"""The mill dialect of FANUC-type controls."""
