"""The surface light field: visibility G, reflection K, bounces."""
