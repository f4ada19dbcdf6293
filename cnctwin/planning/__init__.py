"""Planning: what a plant of so many machines needs, by what was measured."""
