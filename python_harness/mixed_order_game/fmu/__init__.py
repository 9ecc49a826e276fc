"""FMUs: made from game files, read, run, with inputs and graphs that change during the run."""
