"""How alike places are, and how a change spreads over what is (figures 7 and 13)."""
