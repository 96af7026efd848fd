"""The foot for other engines: its files, and the proof that they compute the same."""
