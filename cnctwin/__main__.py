"""`python -m cnctwin`."""

from cnctwin.cli import main

main()
