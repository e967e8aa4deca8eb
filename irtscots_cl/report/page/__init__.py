"""report.html: one file that needs nothing else, with maps and light curves to look into."""
