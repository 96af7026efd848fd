"""Parts of `contact_truth_recovery.py`: recordings that the model made itself, and fits of them."""
