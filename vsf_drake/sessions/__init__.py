"""From a folder of recordings to a verdict: what is in it, what is made of it, what it is worth."""
