"""The report of an optimisation: one self-contained HTML page. One file a section; `page` puts them together."""
