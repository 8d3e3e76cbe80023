"""Image files to texels."""
