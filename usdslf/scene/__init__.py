"""Records of a shot, and what needs them alone."""
