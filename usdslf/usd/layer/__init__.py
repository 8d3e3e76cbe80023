"""The look layer: its opinions, and who else has some."""
