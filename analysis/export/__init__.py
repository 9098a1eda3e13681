"""A study's data as files for other programs: tables, codebook, and a module a format."""
