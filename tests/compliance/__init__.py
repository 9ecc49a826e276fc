"""The FMU in public importers and checkers, for `./dev compliance`."""
