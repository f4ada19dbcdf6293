"""`cnctwin train detector`: a tool-change detector from recorded runs."""
