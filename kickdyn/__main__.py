"""The commands without the console script: `python -m kickdyn COMMAND`."""

from kickdyn.cli.commands import main

if __name__ == "__main__":
    main()
