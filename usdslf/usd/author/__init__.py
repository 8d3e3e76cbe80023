"""Changes to opinions of a look layer."""
