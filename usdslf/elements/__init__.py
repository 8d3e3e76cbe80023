"""Surface elements: where light lives."""
