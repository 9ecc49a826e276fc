"""The command `mog`: one file a command; options, progress and tables that several of them share."""
