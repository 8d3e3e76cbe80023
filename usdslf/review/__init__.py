"""Review of a look layer: pixels, strokes and opinions in one place, and what a person decides about them."""
