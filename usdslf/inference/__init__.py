"""From strokes to the change that explains them."""
