"""What everything stands on: errors, files, records, tables, sentences; no physics."""
