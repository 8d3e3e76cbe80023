"""Unsharp masking of the light field (figure 22), and the paper's Listing 1."""
