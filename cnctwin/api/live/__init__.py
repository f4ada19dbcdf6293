"""The plant as it is now: what the interface hears from the broker and hands to its readers."""
