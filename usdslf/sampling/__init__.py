"""Points, directions and bins; numpy and scipy only."""
