"""What each slip of the printed equations would do to the controlled robot if left in."""
