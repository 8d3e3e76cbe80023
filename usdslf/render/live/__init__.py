"""A picture that comes at once and gets better: light columns of each pixel, gathered frame by frame in kernels."""
