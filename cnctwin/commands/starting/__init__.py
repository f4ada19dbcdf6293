"""The commands by which a plant begins: `init` sets its folder up, `up` runs it."""
