"""Runs the command line: `python -m usdslf`."""

from usdslf.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
