"""The stages of a machine as a hypothesis sees them: axis, cut and heat, each beside what was recorded there."""
