"""A test before it is built: what will go wrong with a scene, and a first scene for one's own mirror."""
