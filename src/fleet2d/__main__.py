"""The command line as `python -m fleet2d`."""

from fleet2d.cli import main

if __name__ == "__main__":
    main()
