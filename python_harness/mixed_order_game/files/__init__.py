"""Files: how a user's files are read, how results are written, temporary folders."""
