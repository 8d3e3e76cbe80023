"""Sources as they are seen from points."""
