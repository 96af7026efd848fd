"""From labelled markers to a scaled person and clinical joint angles."""
