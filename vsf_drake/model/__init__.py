"""What people state: device, person, ground, contact, bench, scenario; units, ranges, sources."""
