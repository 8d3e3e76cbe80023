"""Place of the desktop application for artists (Qt, on the public names of `usdslf`); nothing is here yet."""
