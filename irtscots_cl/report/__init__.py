"""Results for people and programs: tables, JSON, HTML, HDF5, figures."""
