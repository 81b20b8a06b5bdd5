"""How a report is shown: on a page, in pictures, in words."""
