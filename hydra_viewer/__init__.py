"""The desktop application for artists: Qt, on the public names of `usdslf`."""
