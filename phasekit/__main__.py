"""The command line, for ``python -m phasekit``."""

from phasekit.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
