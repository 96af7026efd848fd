"""What a tuning of the foot's stiffness leaves on disk: table, arrays, figures and page."""
