"""What shows arms on the move: a viewer in the browser, and videos; what is shown is computed apart from both."""
