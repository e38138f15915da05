"""`python -m fleet2d.cli`: as the command `fleet2d`."""

from fleet2d.cli import main

if __name__ == "__main__":  # a scenario may name it as the module of a component
    main()
