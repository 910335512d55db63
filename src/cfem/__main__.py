"""`python -m cfem` is `cfem`."""

from cfem.cli.app import main

main()
