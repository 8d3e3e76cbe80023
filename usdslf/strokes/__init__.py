"""What was painted."""
