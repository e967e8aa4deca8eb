"""What the screen shows and the camera records."""
