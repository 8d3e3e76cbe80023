"""What a look layer changes, and what is wrong with it."""
