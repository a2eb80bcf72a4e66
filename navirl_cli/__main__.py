"""Run the command line as ``python -m navirl_cli``."""

from navirl_cli.cli import main

main()
