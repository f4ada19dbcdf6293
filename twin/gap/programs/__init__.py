"""The gap in time: recorded part programs beside what the twin says they take."""
