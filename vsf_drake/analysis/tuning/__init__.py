"""Tunes the stiffness of the foot to the person: costs of a motion that is given, and of one that adapts."""
