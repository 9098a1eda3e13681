"""The verbs of the command line, a typed function each; what one needs it imports itself."""
