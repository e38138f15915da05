"""`python -m fleet2d.cli`: as the command `fleet2d`."""

from fleet2d.cli import main

main()
