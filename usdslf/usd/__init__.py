"""USD: stages in, layers out.  The only code that imports pxr."""
