"""The command `footscan`. Each command imports what it needs when it is called: the command starts at once."""
