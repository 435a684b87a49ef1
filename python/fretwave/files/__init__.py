"""Files that are there as a whole or not at all: locks, checks, readers in processes of their own."""
