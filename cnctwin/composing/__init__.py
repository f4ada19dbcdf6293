"""Composing: from a machine's history, or from run logs, to a case that the gap diagnosis reads (formats, section 5)."""
