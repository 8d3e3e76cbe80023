"""A material at a point of a surface."""
