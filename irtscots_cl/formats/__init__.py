"""Files of others: bytes to arrays with units, and back. Knows no scene."""
