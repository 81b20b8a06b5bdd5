"""What the command line does, one module for each command and for what they share."""
