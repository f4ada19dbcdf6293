"""HEIDENHAIN Klartext: the language of TNC controls."""
