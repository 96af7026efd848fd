"""The validation's report: chapters made of saved sections, and the page, figures and tables made
of chapters."""
