"""Other frames of a shot."""
