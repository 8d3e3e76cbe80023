"""A stage at a frame as records."""
