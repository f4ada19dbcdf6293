"""The report of a gap diagnosis: one self-contained HTML page. One file a section; `page` puts them together."""
