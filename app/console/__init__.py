"""The experimenter's and the participants' pages, served on this machine alone."""
