"""Truth meets measurement: errors, error terms, stray light."""
