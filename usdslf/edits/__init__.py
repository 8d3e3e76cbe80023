"""A change in the inputs of a material, without USD."""
