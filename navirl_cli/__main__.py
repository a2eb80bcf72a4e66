"""Run the command line as ``python -m navirl_cli``."""

from navirl_cli.cli import main

if __name__ == "__main__":  # processes that do not fork import it again
    main()
