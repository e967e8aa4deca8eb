"""What each error source of a test costs in nanometres of height, before there is any hardware."""
