"""Parts of the study of the contact fit (`studies/contact_fit.py`)."""
