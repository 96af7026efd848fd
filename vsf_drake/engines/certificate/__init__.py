"""The proof that other engines compute the same foot: what they are asked, and what they answer."""
